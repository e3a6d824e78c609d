// The graphics device: buffers, textures, and pictures of the view.
"use strict";

const FLOATS = 248; // of the uniform
const TABLES = 1024 + 768 + 1536;

// ln r of the first and the last angular velocity of the table.
const rateRange = () => [Math.log(0.5), Math.log(Math.max(1.01 * GIVEN.reach, 1))];

// Omega r^(3/2) at a radius.
function rateAt(r) {
  const { keplerian, power, radii, rates } = GIVEN.law;
  const by = r ** 1.5;
  if (keplerian) return by / (by + (keplerian.drag ?? state.spin * GIVEN.volumes[0].axis[2]));
  if (power) return power.rate * (power.radius / r) ** power.exponent * by;
  const above = radii.findIndex(x => x > r);
  if (above <= 0) return by * rates[above === 0 ? 0 : rates.length - 1];
  const part = (r - radii[above - 1]) / (radii[above] - radii[above - 1]);
  return by * (rates[above - 1] + part * (rates[above] - rates[above - 1]));
}

function tables() {
  const all = new Float32Array(TABLES);
  all.set(discFlux(Math.min(0.9999, Math.max(-0.9999, state.spin))), 0);
  const [first, last] = rateRange();
  if (GIVEN.law) for (let k = 0; k < 512; k++) all[512 + k] = rateAt(Math.exp(first + (last - first) * k / 511));
  bytesOf(GIVEN.colors).forEach((x, k) => { all[1024 + k] = x / 255; });
  if (GIVEN.shades) all.set(new Float32Array(bytesOf(GIVEN.shades).buffer), 1792);
  return all;
}

function placeWords(words) {
  const a = state.spin, { outer, inner, gap } = horizons(a);
  const wide = (at, x) => { words[at] = x; words[at + 1] = x - words[at]; };
  const distance = isCamera() ? state.radius : GIVEN.distance;
  wide(0, a); wide(2, 1 / outer); words.set([outer, inner, gap, 0], 4);
  wide(8, Math.sin(theta())); wide(10, Math.cos(theta())); wide(12, distance ? 1 / distance : 0);
  words.set([0, state.azimuth * RADIANS], 14);
  if (isCamera()) lens(a, { radius: state.radius, theta: theta(), ...cameraSetup() }).flat().forEach((x, k) => { words[16 + k] = x; words[32 + k] = x - words[16 + k]; });
  return distance ? tortoise(a, distance) : 0;
}

function discWords(words) {
  const { disc } = SCENE, inner = isco(state.spin);
  if (!disc || !state.disc) return;
  const { plunging } = disc, edge = plunging ? horizons(state.spin).outer : Math.max(disc.inner_edge ?? inner, inner);
  words.set([edge, disc.outer_edge, disc.peak_intensity, disc.opaque ? 2 : 1, ...disc.color, inner], 56);
  // Constants of the innermost stable orbit.
  if (plunging) words.set([Math.sqrt(1 - 2 / (3 * inner)), 2 * (1 + 2 * Math.sqrt(3 * inner - 2)) / Math.sqrt(27), plunging.intensity, plunging.exponent], 100);
}

function gasWords(words, coarse) {
  const { gas, effects } = SCENE;
  if (!gas) return 0;
  const slope = gas.profile["power-law"]?.slope ?? -1, fall = gas.motion["angular-momentum"];
  const motion = fall ? 1 : gas.motion === "keplerian" ? 2 : 3, absorbed = effects.absorption ? gas.absorptivity * GIVEN.gas : 0;
  words.set([GIVEN.gas, 1 / gas.scale_radius, 0.5 * gas.flatness ** 2, slope, motion, fall?.l0 ?? 0, absorbed, gas.outer_radius], 104);
  words.set([...gas.color, coarse * 0.15 / (1 + 0.5 * gas.flatness)], 112);
  return gas.outer_radius;
}

function spotWords(words) {
  const spots = (state.spots ? GIVEN.spots : []).slice(0, 8);
  spots.forEach((spot, k) => words.set([
    ...spot.start, spot.sigma, ...spot.axis, spot.peak, ...spot.color, spot.orbit, spot.since ?? 0, +(spot.since !== null), state.spin * spot.axis[2], 0,
  ], 120 + 16 * k));
  return spots.length;
}

function volumeWords(words, panel) {
  const source = GIVEN.volumes[panel === "truth" ? 1 : 0], { volume: [settings] = [] } = SCENE;
  if (!source || !state.volume) return;
  const region = settings.region ?? { r_min: 0, r_max: 1e9, z_width: null };
  words.set([...source.low, source.scale, ...source.high, settings.reference_time ?? 0], 76);
  words.set([...source.axis, settings.injection_time ?? -1e30, region.r_min, region.r_max, region.z_width ?? 1e9, +!!GIVEN.law, ...settings.color], 84);
}

// The uniform of one panel; `coarse` makes the pieces of rays longer.
function uniform(panel, { x, y, width, height }, coarse) {
  const words = new Float32Array(FLOATS), [first, last] = rateRange();
  const delay = placeWords(words), slice = { none: 0, x: 1, y: 2, z: 3 }[state.slice];
  const shifted = state.redshift && state.lensing;
  words.set([width, height, halfField(), +isCamera(), x, y, state.time, delay], 48);
  discWords(words);
  words.set([state.lensing, +shifted, GIVEN.index, state.slow], 64);
  words.set([GIVEN.white / 2 ** state.exposure, +GIVEN.colored, state.sky * GIVEN.sky_brightness, +(panel === "data")], 68);
  words[116] = GIVEN.reach;
  words.set([Math.max(GIVEN.reach, gasWords(words, coarse)), GIVEN.piece * coarse, first, 1 / (last - first)], 72);
  volumeWords(words, panel);
  words[95] = spotWords(words);
  words.set([state.lensing ? 0 : slice, state.cut, panel === "data" ? GIVEN.data.scale : GIVEN.most, GIVEN.data?.field ?? 1], 96);
  return words;
}

class Gpu {
  static async open(tell) {
    if (!navigator.gpu) throw new Error("this browser has no WebGPU");
    const adapter = await navigator.gpu.requestAdapter();
    if (!adapter) throw new Error("no graphics device for WebGPU was found");
    const device = await adapter.requestDevice();
    const gpu = new Gpu();
    gpu.lost = false;
    device.lost.then(info => { gpu.lost = true; tell(`the graphics device was lost: ${info.message} Load the page again.`); });
    device.addEventListener("uncapturederror", event => tell(event.error.message));
    return gpu.prepare(device);
  }

  async prepare(device) {
    Object.assign(this, { device, format: navigator.gpu.getPreferredCanvasFormat() });
    this.context = $("canvas").getContext("webgpu");
    this.context.configure({ device, format: this.format, alphaMode: "opaque" });
    this.module = device.createShaderModule({ code: $("shader").textContent });
    const entry = (binding, more) => ({ binding, visibility: GPUShaderStage.FRAGMENT, ...more });
    this.layout = device.createBindGroupLayout({ entries: [
      entry(0, { buffer: {} }), entry(1, { buffer: { type: "read-only-storage" } }), entry(2, { texture: { viewDimension: "3d" } }),
      entry(3, { sampler: {} }), entry(4, { texture: {} }), entry(5, { texture: {} }),
    ] });
    await this.pipelines();
    this.table = device.createBuffer({ size: 4 * TABLES, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST });
    this.linear = device.createSampler({ magFilter: "linear", minFilter: "linear", addressModeU: "repeat" });
    await this.load();
    return this;
  }

  async pipelines() {
    const { device, module } = this, layout = device.createPipelineLayout({ bindGroupLayouts: [this.layout] });
    const picture = (entryPoint, format) => device.createRenderPipelineAsync({
      layout, vertex: { module, entryPoint: "corner" }, fragment: { module, entryPoint, targets: [{ format }] },
    });
    const enlarge = device.createShaderModule({ code: $("enlarge").textContent });
    const copy = device.createRenderPipelineAsync({
      layout: "auto", vertex: { module: enlarge, entryPoint: "corner" }, fragment: { module: enlarge, entryPoint: "paint", targets: [{ format: this.format }] },
    });
    const follow = device.createComputePipelineAsync({ layout: "auto", compute: { module, entryPoint: "follow" } });
    [this.paint, this.measuring, this.copy, this.follower] = await Promise.all([picture("paint", this.format), picture("measure", "rgba32float"), copy, follow]);
  }

  texture(size, format, dimension = "2d", more = 0) {
    const usage = GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST | more;
    return this.device.createTexture({ size, format, dimension, usage });
  }

  // Volumes, the sky, and room for the pictures of the data.
  async load() {
    const { device } = this, empty = this.texture([1, 1, 1], "r16float", "3d");
    const volume = ({ name, nodes }) => {
      const texture = this.texture(nodes, "r16float", "3d"), layout = { bytesPerRow: 2 * nodes[0], rowsPerImage: nodes[1] };
      device.queue.writeTexture({ texture }, bytesOf(VOLUMES[name]), layout, nodes);
      return texture;
    };
    const volumes = GIVEN.volumes.map(volume);
    this.panorama = await this.loadSky();
    const side = GIVEN.data?.side ?? 1;
    this.measured = this.texture([side, side], "r8unorm");
    const frames = GIVEN.data && bytesOf(VOLUMES.data);
    this.frame = k => frames && device.queue.writeTexture({ texture: this.measured }, frames.subarray(k * side * side, (k + 1) * side * side), { bytesPerRow: side }, [side, side]);
    this.groups = { recovered: this.group(volumes[0] ?? empty), truth: this.group(volumes[1] ?? empty), data: this.group(empty), still: this.group(volumes[0] ?? empty) };
  }

  async loadSky() {
    if (!GIVEN.sky) return this.texture([1, 1], "rgb9e5ufloat");
    const blob = new Blob([bytesOf(GIVEN.sky)], { type: "image/png" });
    const source = await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    const width = source.width, height = source.height / 2, count = width * height;
    const canvas = new OffscreenCanvas(width, 2 * height), context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(source, 0, 0);
    // The last byte of a pixel is in the lower half of the picture.
    const bytes = context.getImageData(0, 0, width, 2 * height).data;
    for (let k = 0; k < count; k++) bytes[4 * k + 3] = bytes[4 * (count + k)];
    const texture = this.texture([width, height], "rgb9e5ufloat");
    this.device.queue.writeTexture({ texture }, bytes.subarray(0, 4 * count), { bytesPerRow: 4 * width }, [width, height]);
    return texture;
  }

  group(volume) {
    const buffer = this.device.createBuffer({ size: 4 * FLOATS, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    const entries = [{ buffer }, { buffer: this.table }, volume.createView(), this.linear, this.panorama.createView(), this.measured.createView()];
    const group = this.device.createBindGroup({ layout: this.layout, entries: entries.map((resource, binding) => ({ binding, resource })) });
    return { buffer, group };
  }

  writeTables() {
    const key = String(state.spin);
    if (this.known !== key) this.device.queue.writeBuffer(this.table, 0, tables());
    this.known = key;
  }

  // Draws panels into a texture: all of it, or some of its rows.
  draw(target, areas, coarse, rows = [0, target.height]) {
    this.writeTables();
    const encoder = this.device.createCommandEncoder();
    const pass = encoder.beginRenderPass({ colorAttachments: [{ view: target.createView(), loadOp: "load", storeOp: "store" }] });
    pass.setPipeline(this.paint);
    for (const area of areas) {
      const { buffer, group } = this.groups[area.panel];
      this.device.queue.writeBuffer(buffer, 0, uniform(area.panel, area, coarse));
      const top = Math.max(area.y, rows[0]), bottom = Math.min(area.y + area.height, rows[1]);
      if (bottom <= top) continue;
      pass.setBindGroup(0, group); pass.setScissorRect(area.x, top, area.width, bottom - top); pass.draw(3);
    }
    pass.end();
    this.device.queue.submit([encoder.finish()]);
    return this.device.queue.onSubmittedWorkDone();
  }

  // Copies a picture, enlarged, into another texture.
  enlarge(from, target) {
    const layout = this.copy.getBindGroupLayout(0), entries = [{ binding: 0, resource: from.createView() }, { binding: 1, resource: this.linear }];
    const encoder = this.device.createCommandEncoder();
    const pass = encoder.beginRenderPass({ colorAttachments: [{ view: target.createView(), loadOp: "clear", storeOp: "store" }] });
    pass.setPipeline(this.copy); pass.setBindGroup(0, this.device.createBindGroup({ layout, entries })); pass.draw(3); pass.end();
    this.device.queue.submit([encoder.finish()]);
  }

  async read(buffer) {
    await buffer.mapAsync(GPUMapMode.READ);
    const copy = buffer.getMappedRange().slice(0);
    buffer.destroy();
    return copy;
  }

  // Linear light of one panel: R, G, B with the sky and the intensity without it, rows from above.
  async measure(panel, width, height) {
    this.writeTables();
    const { device } = this, { buffer } = this.groups.still, { group } = panel === "truth" ? this.groups.truth : this.groups.still;
    const own = panel === "truth" ? this.groups.truth.buffer : buffer;
    device.queue.writeBuffer(own, 0, uniform(panel, { x: 0, y: 0, width, height }, 0.5));
    const texture = device.createTexture({ size: [width, height], format: "rgba32float", usage: GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC });
    const bytesPerRow = Math.ceil(width / 16) * 256;
    const read = device.createBuffer({ size: bytesPerRow * height, usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ });
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginRenderPass({ colorAttachments: [{ view: texture.createView(), loadOp: "clear", storeOp: "store" }] });
    pass.setPipeline(this.measuring); pass.setBindGroup(0, group); pass.draw(3); pass.end();
    encoder.copyTextureToBuffer({ texture }, { buffer: read, bytesPerRow }, [width, height]);
    device.queue.submit([encoder.finish()]);
    const rows = new Float32Array(await this.read(read)), light = new Float32Array(4 * width * height);
    texture.destroy();
    for (let row = 0; row < height; row++) light.set(rows.subarray(row * bytesPerRow / 4, row * bytesPerRow / 4 + 4 * width), row * 4 * width);
    return light;
  }

  // The ray that arrives at a place of the picture: the numbers of follow.wgsl.
  async follow([x, y]) {
    const { device } = this, size = 16 * 2010;
    const view = device.createBuffer({ size: 4 * FLOATS, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    const trail = device.createBuffer({ size, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
    const read = device.createBuffer({ size, usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ });
    const words = uniform("still", { x: 0, y: 0, width: x, height: y }, 1);
    words[72] = 1 / (1.2 * farthest());
    device.queue.writeBuffer(view, 0, words);
    const layout = this.follower.getBindGroupLayout(0);
    const group = device.createBindGroup({ layout, entries: [{ binding: 0, resource: { buffer: view } }, { binding: 6, resource: { buffer: trail } }] });
    const encoder = device.createCommandEncoder(), pass = encoder.beginComputePass();
    pass.setPipeline(this.follower); pass.setBindGroup(0, group); pass.dispatchWorkgroups(1); pass.end();
    encoder.copyBufferToBuffer(trail, 0, read, 0, size);
    device.queue.submit([encoder.finish()]);
    const numbers = new Float32Array(await this.read(read));
    view.destroy(); trail.destroy();
    return numbers;
  }
}

// Radius in M up to which a ray is drawn.
const farthest = () => (isCamera() ? state.radius : Math.max(30, 0.75 * state.field));
