// The ray of one pixel: its numbers, and a drawing in space that is turned by dragging.
"use strict";

const FATES = { 0: "falls into the hole", 1: "escapes to the sky", 3: "no photon arrives there" };

const digits = x => (Number.isFinite(x) ? String(+x.toPrecision(5)).replace("-", "−") : "∞");
const degrees = x => `${digits(((x / RADIANS) % 360 + 360) % 360)}°`;

// What follow.wgsl found, by name.
function decodeRay(numbers) {
  const [lambda, eta, outcome, flags, points, count, nearest, steps] = numbers;
  const row = k => numbers.subarray(4 * k, 4 * k + 4);
  return {
    lambda, eta, outcome, flags, steps,
    turning: outcome === 1 && nearest > 0 ? 1 / nearest : null,
    polar: polarTurns(state.spin, lambda, eta),
    crossings: Array.from({ length: count }, (_, k) => { const [r, azimuth, delay] = row(2 + k); return { r, azimuth, delay }; }),
    path: Array.from({ length: points }, (_, k) => [...row(10 + k)].slice(0, 3)),
  };
}

function rayRows(ray, [x, y]) {
  const place = isCamera() ? `(${digits(x)}, ${digits(y)}) at distance 1` : `α = ${digits(x)} M, β = ${digits(y)} M`;
  const rows = [["place", place], ["fate", FATES[ray.outcome] + (ray.flags & 1 ? " (near the critical curve: within rounding)" : "")],
    ["λ = L/E", `${digits(ray.lambda)} M`], ["η = Q/E²", `${digits(ray.eta)} M²`],
    ["turning point", ray.turning ? `r = ${digits(ray.turning)} M` : "none on its way"],
    ["θ between", ray.polar ? ray.polar.map(x => `${digits(x)}°`).join(" and ") : "one side of the equator"]];
  ray.crossings.forEach(({ r, azimuth, delay }, k) => rows.push([`crossing ${k + 1}`, `r = ${digits(r)} M, φ = ${degrees(azimuth)}, ${digits(delay)} M before`]));
  return rows;
}

function showNumbers(rows) {
  $("numbers").replaceChildren(...rows.flatMap(([name, value]) => ["dt", "dd"].map((tag, k) => {
    const cell = document.createElement(tag);
    cell.textContent = k ? value : name;
    return cell;
  })));
}

const inset = { azimuth: 0.6, elevation: 0.5, zoom: 1 };

// The path, the hole, the equatorial plane and the axis, in parallel projection.
function drawRay(canvas, ray) {
  const size = canvas.width, pen = canvas.getContext("2d");
  const far = Math.max(6, ...ray.crossings.filter(({ r }) => r < 40).map(({ r }) => 1.2 * r), 2 * (ray.turning ?? 5)) / inset.zoom;
  const [sa, ca, se, ce] = [Math.sin(inset.azimuth), Math.cos(inset.azimuth), Math.sin(inset.elevation), Math.cos(inset.elevation)];
  const flat = ([x, y, z]) => { const across = ca * y - sa * x, depth = ca * x + sa * y; return [size / 2 * (1 + across / far), size / 2 * (1 - (ce * z - se * depth) / far), ce * depth + se * z]; };
  const stroke = (points, color, width = 1.5) => {
    pen.beginPath(); points.map(flat).forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.strokeStyle = color; pen.lineWidth = width; pen.stroke();
  };
  const circle = r => Array.from({ length: 97 }, (_, k) => [r * Math.cos(k * Math.PI / 48), r * Math.sin(k * Math.PI / 48), 0]);
  pen.clearRect(0, 0, size, size);
  const pieces = ray.path.slice(1).map((point, k) => [ray.path[k], point]);
  const behind = ([p, q]) => flat(p)[2] + flat(q)[2] < 0;
  pieces.filter(behind).forEach(piece => stroke(piece, "#b8860b"));
  for (const r of [isco(state.spin), SCENE.disc?.outer_edge ?? GIVEN.reach].filter(r => r > 0)) stroke(circle(r), "#456");
  stroke([[0, 0, -far * 0.7], [0, 0, far * 0.7]], "#468");
  pen.beginPath(); pen.arc(size / 2, size / 2, size / 2 * horizons(state.spin).outer / far, 0, 7); pen.fillStyle = "#222"; pen.fill(); pen.strokeStyle = "#888"; pen.stroke();
  pieces.filter(piece => !behind(piece)).forEach(piece => stroke(piece, "#fc3", 2));
  pen.fillStyle = "#f66";
  for (const { r, azimuth } of ray.crossings) { const [x, y] = flat([r * Math.cos(azimuth), r * Math.sin(azimuth), 0]); pen.beginPath(); pen.arc(x, y, 3.5, 0, 7); pen.fill(); }
}
