// Orthographic camera: a distant observer in the direction (azimuth, elevation) from the hole.

function cameraFrame(state) {
  const [a, e] = [state.azimuth, state.elevation].map((degrees) => (degrees * Math.PI) / 180);
  const [sa, ca, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
  return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], towards: [ce * ca, ce * sa, se] };
}

function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Half the field of view, in M.
function halfWidth(scene, state) {
  return (1.1 * scene.rMax) / state.zoom;
}

// Coordinates to the right, upward and towards the observer, in M.
function seen(frame, point) {
  return [dot(frame.right, point), dot(frame.up, point), dot(frame.towards, point)];
}
