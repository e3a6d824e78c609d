// The page: drawing when something has changed, and everything that changes the view.
"use strict";

const tell = text => { $("told").textContent = text; };

// Where panels lie in a picture of this size.
function areas(width, height) {
  const shown = panels(), across = width >= height ? shown.length : 1, down = shown.length / across;
  return shown.map((panel, k) => {
    const [column, row] = [k % across, Math.floor(k / across)];
    const edge = (n, of, size) => Math.round(n * size / of);
    const [x, y] = [edge(column, across, width), edge(row, down, height)];
    return { panel, x, y, width: edge(column + 1, across, width) - x, height: edge(row + 1, down, height) - y };
  });
}

class Page {
  constructor(gpu) {
    Object.assign(this, { gpu, share: 0.25, wanted: true, busy: false, moved: null, rows: null, ray: null, playing: null });
  }

  // Pixels of the canvas, and targets of this size.
  resize() {
    const canvas = $("canvas"), dense = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(x => Math.max(16, Math.round(x * dense)));
    if (canvas.width === width && canvas.height === height && this.sharp) return;
    Object.assign(canvas, { width, height });
    this.sharp = this.target(width, height);
  }

  target(width, height) {
    const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.TEXTURE_BINDING;
    return this.gpu.device.createTexture({ size: [width, height], format: this.gpu.format, usage });
  }

  // A picture as coarse as it takes for 25 ms.
  async sketch() {
    this.resize();
    const [width, height] = [$("canvas").width, $("canvas").height].map(x => Math.max(16, Math.round(x * this.share)));
    if (!this.coarse || this.coarse.width !== width || this.coarse.height !== height) { this.coarse?.destroy(); this.coarse = this.target(width, height); }
    const began = performance.now();
    await this.gpu.draw(this.coarse, areas(width, height), this.share < 0.5 ? 4 : 2);
    const took = performance.now() - began;
    this.gpu.enlarge(this.coarse, this.gpu.context.getCurrentTexture());
    this.share = Math.min(1, Math.max(0.08, this.share * Math.sqrt(25 / Math.max(took, 1))));
    Object.assign(this, { moved: performance.now(), rows: null });
  }

  // A few more rows of the sharp picture, as many as take 50 ms.
  async sharpen() {
    const { width, height } = this.sharp;
    if (!this.rows) { this.gpu.enlarge(this.coarse, this.sharp); this.rows = { done: 0, step: 16, began: performance.now() }; }
    const { rows } = this, until = Math.min(height, rows.done + rows.step), began = performance.now();
    await this.gpu.draw(this.sharp, areas(width, height), 1, [rows.done, until]);
    rows.step = Math.max(4, Math.round(rows.step * Math.min(4, 50 / Math.max(performance.now() - began, 1))));
    rows.done = until;
    this.gpu.enlarge(this.sharp, this.gpu.context.getCurrentTexture());
    if (until < height) return;
    tell(`${width} × ${height} rays in ${(performance.now() - rows.began).toFixed(0)} ms`);
    Object.assign(this, { moved: null, rows: null });
  }

  async step() {
    if (this.wanted) { this.wanted = false; await this.sketch(); await this.follow(); this.overlay(); }
    else if (this.moved !== null && this.playing === null && performance.now() - this.moved > 200) await this.sharpen();
  }

  // One turn of the loop; a device that is lost ends it.
  turn() {
    if (this.gpu.lost) return;
    if (!this.busy) {
      this.busy = true;
      this.play();
      this.step().catch(error => tell(String(error))).finally(() => { this.busy = false; });
    }
    requestAnimationFrame(() => this.turn());
  }

  // Whether what is seen is sharp.
  rests() { return !this.wanted && this.moved === null && !this.busy; }

  show() {
    clamp();
    showState();
    writeLink();
    if (GIVEN.data) this.gpu.frame(frameOf(state.time));
    this.wanted = true;
  }

  play() {
    if (this.playing === null) return;
    const now = performance.now(), [first, last] = GIVEN.times;
    const time = state.time + (last - first) * (now - this.playing) / 12000;
    state.time = time >= last ? first : time;
    this.playing = now;
    this.show();
  }

  togglePlay() {
    if (!GIVEN.times) return;
    this.playing = this.playing === null ? performance.now() : null;
    $("play").textContent = this.playing === null ? "Play" : "Pause";
    this.wanted = true;
  }

  async follow() {
    const at = state.pick ? state.pick.split(",").map(Number) : null;
    $("ray").hidden = !at || !state.lensing;
    if ($("ray").hidden) { this.ray = null; return; }
    this.ray = decodeRay(await this.gpu.follow(at));
    showNumbers(rayRows(this.ray, at));
    drawRay($("inset"), this.ray);
  }

  // What is drawn above the pictures: names, the critical curve, the picked place.
  overlay() {
    const canvas = $("marks"), pen = canvas.getContext("2d");
    Object.assign(canvas, { width: canvas.clientWidth, height: canvas.clientHeight });
    const place = { radius: state.radius, theta: theta() };
    const curve = state.curve && state.lensing ? criticalCurve(state.spin, place, isCamera() ? cameraSetup() : null) : null;
    for (const area of areas(canvas.width, canvas.height)) {
      const scale = Math.min(area.width, area.height) / (2 * halfField());
      const at = ([x, y]) => [area.x + area.width / 2 + x * scale, area.y + area.height / 2 - y * scale];
      pen.save(); pen.beginPath(); pen.rect(area.x, area.y, area.width, area.height); pen.clip();
      if (curve) outline(pen, curve.map(at));
      if (state.pick && state.lensing) cross(pen, at(state.pick.split(",").map(Number)));
      if (panels().length > 1) { pen.fillStyle = "#ddd"; pen.font = "14px system-ui, sans-serif"; pen.fillText(area.panel, area.x + 10, area.y + area.height - 12); }
      pen.restore();
    }
  }
}

function outline(pen, points) {
  pen.beginPath();
  points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.closePath(); pen.strokeStyle = "#4cf"; pen.lineWidth = 1.2; pen.stroke();
}

function cross(pen, [x, y]) {
  pen.beginPath(); pen.arc(x, y, 6, 0, 7); pen.strokeStyle = "#fff"; pen.stroke();
}

// The number of the measured picture next to a time.
function frameOf(time) {
  const off = GIVEN.data.times.map(x => Math.abs(x - time));
  return off.indexOf(Math.min(...off));
}

function showState() {
  for (const input of document.querySelectorAll("#form input[type=range]")) {
    const value = state[input.id];
    if (+input.value !== value) input.value = value;
    input.nextElementSibling.value = digits(value);
  }
  for (const name of SWITCHES) $(name).checked = !!state[name];
  for (const panel of PANELS) $(`panel-${panel}`).checked = panels().includes(panel);
  for (const input of document.querySelectorAll("[name=kind], [name=slice]")) input.checked = state[input.name] === input.value;
  $("row-radius").hidden = $("row-angle").hidden = !isCamera();
  $("row-field").hidden = isCamera();
  $("row-slice").hidden = $("row-cut").hidden = !!state.lensing || !GIVEN.reach;
}

// Rows of the form that this scene has no use for.
function fitForm() {
  const has = { disc: !!SCENE.disc, volume: GIVEN.volumes.length > 0, spots: GIVEN.spots.length > 0, sky: !!GIVEN.sky, redshift: SCENE.effects.redshift, slow: !!GIVEN.times };
  for (const [name, there] of Object.entries(has)) $(name).parentElement.hidden = !there;
  $("row-time").hidden = $("play").hidden = !GIVEN.times;
  if (GIVEN.times) [$("time").min, $("time").max] = GIVEN.times;
  $("cut").min = -GIVEN.reach; $("cut").max = GIVEN.reach;
  for (const panel of ["recovered", "truth", "data"]) $(`panel-${panel}`).parentElement.hidden = PANELS.length < 2 || !PANELS.includes(panel);
  $("name").textContent = GIVEN.title;
  $("left-out").textContent = GIVEN.left_out.length ? `Not shown: ${GIVEN.left_out.join(", ")}.` : "";
}

function toggle(page, name) { state[name] = +!state[name]; page.show(); }

function listenToForm(page) {
  $("form").addEventListener("submit", event => event.preventDefault());
  $("form").addEventListener("input", ({ target }) => {
    if (target.id.startsWith("panel-")) {
      const shown = PANELS.filter(panel => $(`panel-${panel}`).checked);
      state.panels = shown.join("+") || state.panels;
    } else if (target.type === "radio") state[target.name] = target.value;
    else state[target.id] = target.type === "checkbox" ? +target.checked : +target.value;
    if (target.name === "kind") state.pick = "";
    page.show();
  });
  $("play").addEventListener("click", () => page.togglePlay());
  $("home").addEventListener("click", () => { Object.assign(state, startState()); page.show(); });
  $("menu").addEventListener("click", () => { document.body.classList.toggle("closed"); page.wanted = true; });
  $("link").addEventListener("click", () => copy(location.href, "the link"));
  $("command").addEventListener("click", () => {
    const text = command($("canvas").width, $("canvas").height);
    if (text) copy(text, "the command"); else tell("no command renders this drawing");
  });
  $("save").addEventListener("click", () => savePng(page));
  $("exr").addEventListener("click", () => saveExr(page));
}

function copy(text, what) {
  $("shown").value = text; $("shown").hidden = false;
  navigator.clipboard?.writeText(text).then(() => tell(`${what} is in the clipboard`), () => tell(`${what}:`));
}

// The sharp picture with what is drawn above it.
async function savePng(page) {
  const { width, height } = page.sharp, sheet = document.createElement("canvas");
  await page.gpu.draw(page.sharp, areas(width, height), 1);
  page.gpu.enlarge(page.sharp, page.gpu.context.getCurrentTexture());
  Object.assign(sheet, { width, height });
  const pen = sheet.getContext("2d");
  pen.drawImage($("canvas"), 0, 0); pen.drawImage($("marks"), 0, 0, width, height);
  sheet.toBlob(blob => saveFile(blob, "kerrlight.png"));
}

async function saveExr(page) {
  const { width, height } = page.sharp, panel = panels().find(panel => panel !== "data");
  if (!panel) return tell("only what is traced can be saved as EXR");
  const [area] = areas(width, height), light = await page.gpu.measure(panel, area.width, area.height);
  saveFile(exrBytes(light, area.width, area.height, command(area.width, area.height, panel) ?? ""), "kerrlight.exr");
}

// The place of the picture under a point of the window, and its panel.
function placeAt(event) {
  const box = $("canvas").getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const area = areas(box.width, box.height).find(a => x >= a.x && x < a.x + a.width && y >= a.y && y < a.y + a.height);
  const scale = area && 2 * halfField() / Math.min(area.width, area.height);
  return area && [(x - area.x - area.width / 2) * scale, -(y - area.y - area.height / 2) * scale];
}

// Nearer by a factor: the camera moves, the observer's field shrinks.
function approach(by) { if (isCamera()) state.radius *= by; else state.field *= by; }

function listenToPointers(page) {
  const canvas = $("canvas"), fingers = new Map();
  let still = true;
  canvas.addEventListener("pointerdown", event => { canvas.setPointerCapture(event.pointerId); still = fingers.size === 0; fingers.set(event.pointerId, event); });
  canvas.addEventListener("pointerup", event => {
    if (fingers.delete(event.pointerId) && still) { state.pick = (placeAt(event) ?? []).map(x => +x.toPrecision(6)).join(","); page.show(); }
  });
  canvas.addEventListener("pointercancel", event => fingers.delete(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    const before = fingers.get(event.pointerId);
    if (!before || (still && Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY) < 4)) return;
    still = false;
    const other = [...fingers.values()].find(finger => finger.pointerId !== event.pointerId);
    if (other) {
      const apart = finger => Math.max(Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY), 1);
      approach(apart(before) / apart(event));
    } else { state.azimuth -= (event.clientX - before.clientX) * 0.3; state.inclination -= (event.clientY - before.clientY) * 0.2; }
    fingers.set(event.pointerId, event);
    page.show();
  });
  canvas.addEventListener("wheel", event => { event.preventDefault(); approach(Math.exp(event.deltaY * 0.001)); page.show(); }, { passive: false });
}

function listenToKeys(page) {
  const later = by => () => { const [first, last] = GIVEN.times ?? [state.time, state.time]; state.time += by * (last - first); };
  const keys = {
    ArrowLeft: () => { state.azimuth -= 3; }, ArrowRight: () => { state.azimuth += 3; },
    ArrowUp: () => { state.inclination -= 1; }, ArrowDown: () => { state.inclination += 1; },
    "+": () => approach(0.95), "=": () => approach(0.95), "-": () => approach(1 / 0.95),
    ",": later(-0.01), ".": later(0.01), " ": () => page.togglePlay(),
    l: () => toggle(page, "lensing"), c: () => toggle(page, "curve"), Escape: () => { state.pick = ""; $("shown").hidden = true; },
  };
  document.addEventListener("keydown", event => {
    if (event.target.closest("input, textarea, button") || event.ctrlKey || event.metaKey || event.altKey || !(event.key in keys)) return;
    event.preventDefault(); keys[event.key](); page.show();
  });
}

function listenToInset(page) {
  const canvas = $("inset");
  let last = null;
  canvas.addEventListener("pointerdown", event => { canvas.setPointerCapture(event.pointerId); last = event; });
  canvas.addEventListener("pointerup", () => { last = null; });
  canvas.addEventListener("pointermove", event => {
    if (!last) return;
    inset.azimuth -= 0.01 * (event.clientX - last.clientX); inset.elevation += 0.01 * (event.clientY - last.clientY);
    last = event;
    if (page.ray) drawRay(canvas, page.ray);
  });
  canvas.addEventListener("wheel", event => { event.preventDefault(); inset.zoom *= Math.exp(-0.001 * event.deltaY); if (page.ray) drawRay(canvas, page.ray); }, { passive: false });
}

async function start() {
  readLink();
  fitForm();
  showState();
  const page = new Page(await Gpu.open(tell));
  for (const listen of [listenToForm, listenToPointers, listenToKeys, listenToInset]) listen(page);
  addEventListener("resize", () => { page.wanted = true; });
  addEventListener("hashchange", () => { Object.assign(state, startState()); readLink(); page.show(); });
  window.kerrlight = page;
  page.show();
  page.turn();
}
start().catch(error => tell(String(error.message ?? error)));
