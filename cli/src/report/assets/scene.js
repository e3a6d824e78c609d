// Data embedded in the page: volumes of bytes, x varying fastest. A byte of 255 stands for `scale`, in units of emission.

function decodeBytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

function readScene() {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  scene.colors = decodeBytes(scene.colors);
  for (const volume of scene.volumes) {
    volume.bytes = decodeBytes(volume.bytes);
  }
  scene.axis = scene.motion ? unit(scene.motion.axis) : [0, 0, 1];
  scene.rateTable = rateTable(scene);
  return scene;
}

function unit(vector) {
  const norm = Math.hypot(...vector);
  return vector.map((x) => x / norm);
}

// Angular velocity at a radius: interpolated linearly in the table, constant outside it.
function rateAt(rates, r) {
  const above = rates.findIndex((row) => row[0] > r);
  if (above === 0) return rates[0][1];
  if (above < 0) return rates[rates.length - 1][1];
  const [[r0, rate0], [r1, rate1]] = [rates[above - 1], rates[above]];
  return rate0 + ((rate1 - rate0) * (r - r0)) / (r1 - r0);
}

const RATES = 512;

// The same table, resampled at equal steps from 0 to rMax for the renderers.
function rateTable(scene) {
  const rate = (k) => rateAt(scene.motion.rates, (scene.rMax * k) / (RATES - 1));
  return Float32Array.from({ length: RATES }, (_, k) => (scene.motion ? rate(k) : 0));
}

// Time relative to the reference time of the volumes.
function elapsed(scene, state) {
  return scene.motion ? state.time - scene.motion.reference : 0;
}

// A number with three significant digits, in its shortest form.
function digits(x) {
  return String(Number(x.toPrecision(3))).replace("-", "−");
}
