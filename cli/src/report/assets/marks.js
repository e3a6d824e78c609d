// Overlay: the event horizon, the equator, the axis of rotation, coordinate axes and the colour bar.

const MARKS = { edge: "#7882a0", axis: "#6ec8ff", ring: "#789678", farRing: "#3c4c3c", text: "#e8e8e8" };

// Light text with a dark outline, legible on any background.
function drawText(context, text, x, y, color) {
  context.lineJoin = "round";
  context.strokeStyle = "#000";
  context.lineWidth = 3;
  context.strokeText(text, x, y);
  context.lineWidth = 1.3;
  context.fillStyle = color;
  context.fillText(text, x, y);
}

function drawPiece(context, toCanvas, ends, color) {
  context.strokeStyle = color;
  context.beginPath();
  context.moveTo(...toCanvas(ends[0]));
  context.lineTo(...toCanvas(ends[1]));
  context.stroke();
}

// Draws a 3D polyline without the segments that the hole hides.
function drawLine(context, view, points, near, far) {
  const places = points.map((point) => seen(view.frame, point));
  const hidden = (p) => p[2] < 0 && Math.hypot(p[0], p[1]) < view.hole;
  for (let k = 1; k < places.length; k += 1) {
    const ends = [places[k - 1], places[k]];
    if (!ends.some(hidden)) {
      drawPiece(context, view.toCanvas, ends, ends[0][2] + ends[1][2] < 0 ? far : near);
    }
  }
}

function range(from, to, count, point) {
  return Array.from({ length: count + 1 }, (_, k) => point(from + ((to - from) * k) / count));
}

function drawHole(context, view) {
  const [x, y] = view.toCanvas([0, 0]);
  context.strokeStyle = MARKS.edge;
  context.beginPath();
  context.arc(x, y, view.hole * view.scale, 0, 2 * Math.PI);
  context.stroke();
}

// Starts at the horizon, since the inside is hidden.
function drawAxis(context, view, scene) {
  const along = (s) => scene.axis.map((x) => x * s);
  for (const sign of [-1, 1]) {
    const points = range(sign * scene.holeRadius, sign * scene.rMax, 40, along);
    drawLine(context, view, points, MARKS.axis, MARKS.axis);
  }
  const name = seen(view.frame, along(0.85 * scene.rMax));
  if (name[2] >= 0 || Math.hypot(name[0], name[1]) > view.hole) {
    const [x, y] = view.toCanvas(name);
    drawText(context, "axis", x + 7, y + 4, MARKS.axis);
  }
}

// Directions of x, y and z, in the lower right corner.
function drawDirections(context, view, size) {
  const [x0, y0] = [size - 48, size - 48];
  for (const [name, point] of [["x", [30, 0, 0]], ["y", [0, 30, 0]], ["z", [0, 0, 30]]]) {
    const [right, up] = seen(view.frame, point);
    context.strokeStyle = MARKS.text;
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x0 + right, y0 - up);
    context.stroke();
    drawText(context, name, x0 + 1.25 * right - 4, y0 - 1.25 * up + 4, MARKS.text);
  }
}

// Colour bar with the intensity of its upper end.
function drawColors(context, scene, white, size) {
  const [left, top, wide, tall] = [14, size - 40, 0.28 * size, 10];
  const last = scene.colors.length / 3 - 1;
  for (let x = 0; x < wide; x += 1) {
    const k = 3 * Math.round((last * x) / wide);
    context.fillStyle = `rgb(${scene.colors[k]} ${scene.colors[k + 1]} ${scene.colors[k + 2]})`;
    context.fillRect(left + x, top, 1.5, tall);
  }
  context.strokeStyle = MARKS.edge;
  context.strokeRect(left, top, wide, tall);
  drawText(context, `0 to ${digits(white)} ${scene.unit} · M`, left, top + 27, MARKS.text);
}

function drawScale(context, view, size) {
  const lengths = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
  const length = lengths.filter((x) => x * view.scale < 0.3 * size).pop() ?? 0.1;
  context.fillStyle = MARKS.text;
  context.fillRect(14, 18, length * view.scale, 3);
  drawText(context, `${length} M`, 14, 36, MARKS.text);
}

function drawMarks(canvas, scene, state, white, size) {
  const ratio = canvas.width / size;
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, size, size);
  context.font = "13px system-ui, sans-serif";
  context.lineWidth = 1.3;
  const scale = size / 2 / halfWidth(scene, state);
  const toCanvas = ([x, y]) => [size / 2 + scale * x, size / 2 - scale * y];
  const view = { frame: cameraFrame(state), hole: scene.holeRadius, scale, toCanvas };
  const circle = (a) => [scene.rMax * Math.cos(a), scene.rMax * Math.sin(a), 0];
  drawHole(context, view);
  drawLine(context, view, range(0, 2 * Math.PI, 120, circle), MARKS.ring, MARKS.farRing);
  if (scene.motion) drawAxis(context, view, scene);
  drawDirections(context, view, size);
  drawColors(context, scene, white, size);
  drawScale(context, view, size);
}
