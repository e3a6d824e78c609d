// The viewer: state, controls and scheduling of frames.

const element = (id) => document.getElementById(id);

function setStatus(text, note) {
  element("status").textContent = text;
  element("status-note").textContent = note;
}

window.addEventListener("error", (event) => setStatus(`error: ${event.message}`, ""));

function startState(scene) {
  return {
    azimuth: 40, elevation: 20, zoom: 1, volume: 0, threshold: 0, brightness: 0,
    time: scene.motion ? clamp(scene.motion.reference, ...scene.motion.times) : 0,
  };
}

function clamp(x, low, high) {
  return Math.min(Math.max(x, low), high);
}

// Ranges of the parameters of a URL fragment such as #time=0.5&azimuth=40&elevation=20&volume=truth.
function limits(scene) {
  const time = scene.motion ? scene.motion.times : [0, 0];
  return {
    azimuth: [-720, 720], elevation: [-90, 90], zoom: [0.5, 12], threshold: [0, 1], brightness: [-2, 4], time,
  };
}

function applyFragment(scene, state) {
  const given = new URLSearchParams(location.hash.slice(1));
  for (const [name, [low, high]] of Object.entries(limits(scene))) {
    const value = Number.parseFloat(given.get(name));
    if (Number.isFinite(value)) state[name] = clamp(value, low, high);
  }
  const volume = scene.volumes.findIndex((v) => v.name === given.get("volume"));
  if (volume >= 0) state.volume = volume;
}

function addCanvas(stage) {
  const canvas = document.createElement("canvas");
  stage.append(canvas);
  return canvas;
}

// Maximum intensity of the first view. It is white at brightness 0, for every volume and time.
function brightest(scene) {
  let most = 0;
  scene.volumes.forEach((_, volume) => {
    const light = lightMap(scene, { ...startState(scene), volume }, 72);
    most = light.reduce((a, b) => Math.max(a, b), most);
  });
  return most > 0 ? most : scene.scale;
}

function softwareChoice(canvas, scene) {
  return { name: "fallback", canvas, draw: softwareRenderer(canvas, scene), finish: () => {}, first: 128, most: 256 };
}

// `first` and `most`: resolution of the first frame and upper limit of the resolution, in pixels along a side.
function chooseRenderer(stage, scene) {
  const forced = new URLSearchParams(location.hash.slice(1)).get("renderer") === "fallback";
  const canvas = addCanvas(stage);
  const gpu = forced ? null : gpuRenderer(canvas, scene);
  if (gpu) return { name: "webgl2", canvas, ...gpu, first: softwareName(gpu.by) ? 192 : 4096, most: 4096 };
  canvas.remove();
  return softwareChoice(addCanvas(stage), scene);
}

function noteOf({ name, by }) {
  if (name === "fallback") return "(on the CPU: WebGL2 is not used)";
  const software = softwareName(by);
  return software ? `(on the CPU: ${software} instead of a GPU)` : "(on the GPU)";
}

// Time budget of a frame in milliseconds: during interaction, and at rest.
const MOVING = 50;
const RESTING = 700;

// Resolution in pixels along a side: what the time budget allowed so far, or what the URL fragment sets.
class Quality {
  constructor({ first, most }) {
    const fixed = Number.parseInt(new URLSearchParams(location.hash.slice(1)).get("pixels"), 10);
    Object.assign(this, { first, most, fixed, perPixel: null });
  }

  measured(milliseconds, size) {
    const now = milliseconds / (size * size);
    this.perPixel = this.perPixel === null ? now : 0.5 * (this.perPixel + now);
  }

  size(full, budget) {
    if (this.fixed > 0) return Math.min(this.fixed, this.most);
    const able = this.perPixel === null ? this.first : Math.floor(Math.sqrt(budget / this.perPixel));
    return Math.min(full, this.most, Math.max(able, 96));
  }
}

class Viewer {
  constructor(scene) {
    this.scene = scene;
    this.state = startState(scene);
    this.white = brightest(scene);
    this.stage = element("stage");
    this.useRenderer(chooseRenderer(this.stage, scene));
    this.asked = false;
    applyFragment(scene, this.state);
  }

  useRenderer(renderer) {
    this.renderer = renderer;
    this.quality = new Quality(renderer);
    this.marks = addCanvas(this.stage);
    renderer.canvas.addEventListener("webglcontextlost", () => this.fallBack());
  }

  fallBack() {
    this.stage.replaceChildren();
    this.useRenderer(softwareChoice(addCanvas(this.stage), this.scene));
    this.ask();
  }

  // Fits canvases to the stage, at most as large as the time budget allows.
  resize(budget) {
    const size = Math.max(this.stage.clientWidth, 1);
    const full = Math.round(size * Math.min(window.devicePixelRatio || 1, 2));
    const pixels = this.quality.size(full, budget);
    for (const [canvas, wanted] of [[this.renderer.canvas, pixels], [this.marks, full]]) {
      if (canvas.width !== wanted) canvas.width = canvas.height = wanted;
    }
    return { size, full };
  }

  draw(budget) {
    this.asked = false;
    const { size, full } = this.resize(budget);
    const white = this.white / 2 ** this.state.brightness;
    const begun = performance.now();
    this.renderer.draw(this.state, white);
    this.renderer.finish();
    this.quality.measured(performance.now() - begun, this.renderer.canvas.width);
    drawMarks(this.marks, this.scene, this.state, white, size);
    this.showState();
    setStatus(`ready: ${this.renderer.name}`, noteOf(this.renderer));
    this.sharpen(full);
  }

  // Full resolution at rest.
  sharpen(full) {
    clearTimeout(this.rest);
    const drawn = this.renderer.canvas.width;
    if (this.quality.size(full, RESTING) > 1.2 * drawn) {
      this.rest = setTimeout(() => this.draw(RESTING), 250);
    }
  }

  ask() {
    if (!this.asked) requestAnimationFrame(() => this.draw(MOVING));
    this.asked = true;
  }

  change(values) {
    Object.assign(this.state, values);
    for (const [name, [low, high]] of Object.entries(limits(this.scene))) {
      this.state[name] = clamp(this.state[name], low, high);
    }
    this.state.azimuth = ((((this.state.azimuth + 180) % 360) + 360) % 360) - 180;
    this.ask();
  }

  showState() {
    const { scene, state } = this;
    for (const name of ["time", "brightness", "threshold"]) element(name).value = state[name];
    if (scene.motion) element("time-text").textContent = `${digits(state.time)} ${scene.motion.unit}`;
    element("brightness-text").textContent = `× ${digits(2 ** state.brightness)}`;
    element("threshold-text").textContent = `${digits(state.threshold * scene.scale)} ${scene.unit}`;
    document.querySelectorAll("#volumes input").forEach((input, k) => (input.checked = k === state.volume));
  }
}

function addVolumes(viewer) {
  viewer.scene.volumes.forEach((volume, k) => {
    const [label, input] = [document.createElement("label"), document.createElement("input")];
    Object.assign(input, { type: "radio", name: "volume" });
    input.addEventListener("change", () => viewer.change({ volume: k }));
    label.append(input, volume.name);
    element("volumes").append(label);
  });
  element("volumes").hidden = viewer.scene.volumes.length < 2;
}

function addSliders(viewer) {
  const { motion } = viewer.scene;
  element("time-row").hidden = element("play").hidden = !motion;
  if (motion) [element("time").min, element("time").max] = motion.times;
  for (const name of ["time", "brightness", "threshold"]) {
    element(name).addEventListener("input", (event) => {
      viewer.change({ [name]: Number(event.target.value) });
    });
  }
  element("reset").addEventListener("click", () => {
    viewer.change({ azimuth: 40, elevation: 20, zoom: 1 });
  });
}

// Plays all times in a loop of 12 s.
function addPlay(viewer) {
  const button = element("play");
  let last = null;
  const step = (now) => {
    if (last === null) return;
    const [first, end] = viewer.scene.motion.times;
    const time = viewer.state.time + ((end - first) * (now - last)) / 12000;
    viewer.change({ time: time > end ? first : time });
    last = now;
    requestAnimationFrame(step);
  };
  button.addEventListener("click", () => {
    last = last === null ? performance.now() : null;
    button.textContent = last === null ? "Play" : "Pause";
    requestAnimationFrame(step);
  });
}

// One pointer rotates, two zoom.
function addPointers(viewer) {
  const { stage, state } = viewer;
  const pointers = new Map();
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  stage.addEventListener("pointermove", (event) => {
    const old = pointers.get(event.pointerId);
    if (!old) return;
    const before = pointers.size === 2 ? spread() : 0;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (before > 0) {
      viewer.change({ zoom: (state.zoom * spread()) / before });
    } else {
      const [dx, dy] = [event.clientX - old[0], event.clientY - old[1]];
      viewer.change({ azimuth: state.azimuth - 0.4 * dx, elevation: state.elevation + 0.4 * dy });
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    stage.addEventListener(end, (event) => pointers.delete(event.pointerId));
  }
}

// The wheel scrolls the page until the viewer has been clicked.
function addWheelAndKeys(viewer) {
  const { stage, state } = viewer;
  stage.addEventListener("wheel", (event) => {
    if (document.activeElement !== stage) return;
    event.preventDefault();
    viewer.change({ zoom: state.zoom * Math.exp(-0.002 * event.deltaY) });
  }, { passive: false });
  const keys = {
    ArrowLeft: () => ({ azimuth: state.azimuth + 5 }),
    ArrowRight: () => ({ azimuth: state.azimuth - 5 }),
    ArrowUp: () => ({ elevation: state.elevation - 5 }),
    ArrowDown: () => ({ elevation: state.elevation + 5 }),
    "+": () => ({ zoom: state.zoom * 1.15 }),
    "-": () => ({ zoom: state.zoom / 1.15 }),
  };
  stage.addEventListener("keydown", (event) => {
    if (!(event.key in keys)) return;
    event.preventDefault();
    viewer.change(keys[event.key]());
  });
}

function start() {
  const viewer = new Viewer(readScene());
  for (const add of [addVolumes, addSliders, addPlay, addPointers, addWheelAndKeys]) add(viewer);
  window.addEventListener("resize", () => viewer.ask());
  window.addEventListener("hashchange", () => {
    applyFragment(viewer.scene, viewer.state);
    viewer.ask();
  });
  viewer.draw(MOVING);
}

start();
