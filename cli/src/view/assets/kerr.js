// Closed forms of Kerr black holes that the page needs beside the shaders: G = c = M = 1.
"use strict";

const RADIANS = Math.PI / 180;

// The radius of the innermost stable orbit (Bardeen, Press & Teukolsky 1972).
function isco(a) {
  const z1 = 1 + Math.cbrt(1 - a * a) * (Math.cbrt(1 + a) + Math.cbrt(1 - a));
  const z2 = Math.sqrt(3 * a * a + z1 * z1);
  return 3 + z2 - Math.sign(a || 1) * Math.sqrt((3 - z1) * (3 + z1 + 2 * z2));
}

function horizons(a) {
  const half = Math.sqrt((1 - a) * (1 + a));
  return { outer: 1 + half, inner: a * a / (1 + half), gap: 2 * half };
}

// r* with dr*/dr = (r^2 + a^2)/Delta; r* - r - 2 ln r vanishes at infinity.
function tortoise(a, r) {
  const { outer, inner, gap } = horizons(a);
  if (gap < 1e-9) return r + 2 * Math.log(r - 1) - 2 / (r - 1);
  const log = x => Math.log(Math.max(1 - x / r, 1e-300));
  const near = 2 * outer / gap * log(outer), far = 2 * inner / gap * log(inner);
  return r + 2 * Math.log(r) + near - far;
}

// What a camera's place does to clocks and rulers: the frame of zero angular momentum.
function zamo(a, r, theta) {
  const [s, c] = [Math.sin(theta), Math.cos(theta)];
  const sigma = r * r + a * a * c * c, delta = r * r - 2 * r + a * a;
  const area = (r * r + a * a) ** 2 - a * a * delta * s * s;
  return { s, c, sigma, delta, lapse: Math.sqrt(sigma * delta / area), drag: 2 * a * r / area, girth: Math.sqrt(area / sigma) };
}

// Velocity of a camera along e_r, e_theta, e_phi of that frame.
function velocity(a, r, { s, lapse, drag, girth, sigma, delta }, motion) {
  const around = rate => [0, 0, girth * s * (rate - drag) / lapse];
  if (motion === "free-fall") return [-Math.sqrt((1 - lapse) * (1 + lapse)), 0, 0];
  if (motion === "keplerian") return around(1 / (r ** 1.5 + a));
  const still = around(0);
  const moves = motion === "static" && Math.hypot(...still) < 1 && delta - a * a * s * s > 0 && sigma > 0;
  return moves ? still : [0, 0, 0];
}

// (Energy, p_r, p_phi/sin theta, p_theta) of the photon from forward + x right + y up as a linear map of
// (|direction|, 1, x, y): rows of a camera's lens.
function lens(a, { radius, theta, motion, axes }) {
  const frame = zamo(a, radius, theta), v = velocity(a, radius, frame, motion);
  const speed = v[0] ** 2 + v[1] ** 2 + v[2] ** 2, gamma = 1 / Math.sqrt(1 - speed);
  const column = (energy, p) => {
    const along = v[0] * p[0] + v[1] * p[1] + v[2] * p[2];
    const factor = (speed > 0 ? (gamma - 1) * along / speed : 0) + gamma * energy;
    const k = p.map((x, j) => x + factor * v[j]);
    const around = k[2] * frame.girth;
    const polar = k[1] * Math.sqrt(frame.sigma);
    return [frame.lapse * gamma * (energy + along) + frame.drag * frame.s * around, k[0], around, polar];
  };
  const back = axis => axis.map(x => -x);
  const columns = [column(1, [0, 0, 0]), column(0, back(axes.forward)), column(0, back(axes.right)), column(0, back(axes.up))];
  return [0, 1, 2, 3].map(row => columns.map(entry => entry[row]));
}

// Directions of a camera that is turned away from the hole: to the right, then up, then clockwise.
function cameraAxes(yaw, pitch, roll) {
  const turn = (from, to, angle) => {
    const [s, c] = [Math.sin(angle), Math.cos(angle)];
    return [from.map((x, k) => c * x + s * to[k]), from.map((x, k) => -s * x + c * to[k])];
  };
  let [right, up, forward] = [[0, 0, 1], [0, -1, 0], [-1, 0, 0]];
  [forward, right] = turn(forward, right, yaw);
  [forward, up] = turn(forward, up, pitch);
  [up, right] = turn(up, right, roll);
  return { right, up, forward };
}

// Flux of a thin disc (Page & Thorne 1974, eq. 15n) over that of its peak, by (r/isco)^3, at 512 values of
// sqrt(isco/r) from 0 to 1.
function discFlux(a) {
  const inner = isco(a), x0 = Math.sqrt(inner), angle = Math.acos(a) / 3;
  const roots = [2 * Math.cos(angle - Math.PI / 3), 2 * Math.cos(angle + Math.PI / 3), -2 * Math.cos(angle)];
  const terms = roots.map((x, k) => {
    const [y, z] = [roots[(k + 1) % 3], roots[(k + 2) % 3]];
    const merged = 1 - Math.abs(a) < 1e-14 && Math.abs(Math.abs(x) - 1) < 1e-6;
    return merged ? null : [x, 0.75 * x * (x * x - 1) ** 2 / ((x - y) * (x - z))];
  }).filter(Boolean);
  // Of s = sqrt(isco/r), by s^6.
  const flux = s => {
    const x = x0 / s;
    let bracket = x - x0 - 1.5 * a * Math.log(x / x0);
    for (const [root, weight] of terms) bracket -= weight * Math.log((x - root) / (x0 - root));
    return Math.max(bracket, 0) / (x ** 4 * (x ** 3 - 3 * x + 2 * a)) / s ** 6;
  };
  let peak = 0;
  for (let k = 1; k < 4000; k++) peak = Math.max(peak, flux(k / 4000) * (k / 4000) ** 6);
  return Array.from({ length: 512 }, (_, k) => (k === 511 ? 0 : flux(Math.max(k, 0.5) / 511) / peak));
}

// Constants of motion of photons that circle at a radius (Bardeen 1973).
function sphericalPhoton(a, r) {
  const delta = r * r - 2 * r + a * a;
  return [(r * r + a * a) / a - 2 * r * delta / (a * (r - 1)), r ** 3 * (4 * a * a - r * (r - 3) ** 2) / (a * a * (r - 1) ** 2)];
}

// Radii between which there are such photons: prograde and retrograde circles.
function photonRadii(a) {
  return [-Math.abs(a), Math.abs(a)].map(x => 2 * (1 + Math.cos(2 / 3 * Math.acos(x))));
}

function solve(rows, right) {
  const m = rows.map((row, k) => [...row, right[k]]);
  for (let k = 0; k < 4; k++) {
    const best = [...m.keys()].slice(k).reduce((p, q) => (Math.abs(m[q][k]) > Math.abs(m[p][k]) ? q : p));
    [m[k], m[best]] = [m[best], m[k]];
    for (let j = 0; j < 4; j++) if (j !== k) {
      const by = m[j][k] / m[k][k];
      m[j] = m[j].map((x, c) => x - by * m[k][c]);
    }
  }
  return m.map((row, k) => row[4] / row[k]);
}

// The critical curve as places of the picture: on the screen of an observer, or through a camera's lens.
function criticalCurve(spin, place, camera) {
  const a = Math.abs(spin) < 1e-3 ? 1e-3 : spin, [inner, outer] = photonRadii(a);
  const s = Math.max(Math.abs(Math.sin(place.theta)), 1e-4), c = Math.cos(place.theta);
  const rows = camera && lens(a, { ...place, ...camera });
  const [above, below] = [[], []];
  for (let k = 0; k <= 720; k++) {
    const r = 0.5 * (inner + outer) - 0.5 * (outer - inner) * Math.cos(Math.PI * k / 720);
    const [lambda, eta] = sphericalPhoton(a, r), square = eta + c * c * (a * a - (lambda / s) ** 2);
    if (!(square >= 0)) continue;
    for (const [list, sign] of [[above, 1], [below, -1]]) {
      const at = rows ? throughLens(a, r, place, rows, [lambda, eta, sign * Math.sqrt(square)]) : [-lambda / s, sign * Math.sqrt(square)];
      if (at) list.push(at);
    }
  }
  return [...above, ...below.reverse()];
}

function throughLens(a, orbit, { radius: r, theta }, rows, [lambda, eta, polar]) {
  const { s, sigma, delta } = zamo(a, r, theta);
  const radial = (r * r + a * a - a * lambda) ** 2 - delta * (eta + (lambda - a) ** 2);
  const along = Math.sqrt(Math.max(radial, 0) / (delta * sigma)) * (r > orbit ? 1 : -1);
  const [norm, one, x, y] = solve(rows, [1, along, lambda / Math.max(s, 1e-4), polar]);
  return one > 0 && norm > 0 ? [x / one, y / one] : null;
}

// Polar angles between which a ray moves, in degrees; null where it keeps to one side or circles about the axis.
function polarTurns(a, lambda, eta) {
  const b = a * a - eta - lambda * lambda, root = Math.sqrt(Math.max(b * b + 4 * a * a * eta, 0));
  const square = b > 0 ? (b + root) / (2 * a * a) : 2 * eta / (root - b);
  return eta > 0 && square <= 1 ? [1, -1].map(sign => Math.acos(sign * Math.sqrt(square)) / RADIANS) : null;
}
