// CPU ray marcher: the algorithm of the GPU renderer with fewer rays and longer steps.

const STEPS = 64;

// Trilinear interpolation at a point (in M); values from 0 to 255.
function sample(volume, p) {
  const [cell, part] = [[0, 0, 0], [0, 0, 0]];
  for (let k = 0; k < 3; k += 1) {
    const last = volume.nodes[k] - 1;
    const at = ((p[k] - volume.low[k]) / (volume.high[k] - volume.low[k])) * last;
    if (!(at >= 0 && at <= last)) return 0;
    cell[k] = Math.min(Math.floor(at), last - 1);
    part[k] = at - cell[k];
  }
  const [nx, ny] = volume.nodes;
  const first = (cell[2] * ny + cell[1]) * nx + cell[0];
  const bytes = volume.bytes;
  const edge = (at) => bytes[at] + (bytes[at + 1] - bytes[at]) * part[0];
  const side = (at) => edge(at) + (edge(at + nx) - edge(at)) * part[1];
  return side(first) + (side(first + nx * ny) - side(first)) * part[2];
}

// Position at the reference time of the matter that is now at a point.
function pulledBack(scene, time, p) {
  if (time === 0) return p;
  const at = Math.min(Math.hypot(...p) / scene.rMax, 1) * (RATES - 1);
  const first = Math.min(Math.floor(at), RATES - 2);
  const [a, b] = [scene.rateTable[first], scene.rateTable[first + 1]];
  const angle = -(a + (b - a) * (at - first)) * time;
  const [s, c] = [Math.sin(angle), Math.cos(angle)];
  const [x, y, z] = scene.axis;
  const along = dot(scene.axis, p) * (1 - c);
  return [
    p[0] * c + (y * p[2] - z * p[1]) * s + x * along,
    p[1] * c + (z * p[0] - x * p[2]) * s + y * along,
    p[2] * c + (x * p[1] - y * p[0]) * s + z * along,
  ];
}

// Intensity along one ray, in units of emission times M.
function lightAt(scene, state, frame, right, up) {
  const square = right * right + up * up;
  const near = Math.sqrt(Math.max(scene.rMax ** 2 - square, 0));
  const ball = scene.holeRadius ** 2 - square;
  const far = ball > 0 ? Math.sqrt(ball) : -near;
  const steps = Math.ceil((STEPS * (near - far)) / (2 * scene.rMax));
  const [volume, time, ds] = [scene.volumes[state.volume], elapsed(scene, state), (near - far) / steps];
  let sum = 0;
  for (let k = 0; k < steps; k += 1) {
    const s = far + (k + 0.5) * ds;
    const p = [0, 1, 2].map((i) => right * frame.right[i] + up * frame.up[i] + s * frame.towards[i]);
    const value = sample(volume, pulledBack(scene, time, p)) / 255;
    if (value >= state.threshold) sum += value;
  }
  return steps > 0 ? sum * ds * scene.scale : 0;
}

// Intensities of size × size rays, row by row from the top.
function lightMap(scene, state, size) {
  const [frame, half] = [cameraFrame(state), halfWidth(scene, state)];
  const at = (k) => half * ((2 * k + 1) / size - 1);
  const light = new Float32Array(size * size);
  for (let row = 0; row < size; row += 1) {
    for (let column = 0; column < size; column += 1) {
      light[row * size + column] = lightAt(scene, state, frame, at(column), -at(row));
    }
  }
  return light;
}

// Renderer that draws on a canvas of any size.
function softwareRenderer(canvas, scene) {
  const context = canvas.getContext("2d");
  const last = scene.colors.length / 3 - 1;
  return (state, white) => {
    const size = canvas.width;
    const picture = context.createImageData(size, size);
    const at = (k) => halfWidth(scene, state) * ((2 * k + 1) / size - 1);
    lightMap(scene, state, size).forEach((light, k) => {
      const color = 3 * Math.round(Math.min(light / white, 1) * last);
      const hidden = Math.hypot(at(k % size), at(Math.floor(k / size))) < scene.holeRadius;
      const ground = hidden ? [26, 30, 40] : [0, 0, 0];
      for (let c = 0; c < 3; c += 1) {
        picture.data[4 * k + c] = Math.max(scene.colors[color + c], ground[c]);
      }
      picture.data[4 * k + 3] = 255;
    });
    context.putImageData(picture, 0, 0);
  };
}
