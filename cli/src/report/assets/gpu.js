// GPU ray marcher: one fragment per ray, through a 3D texture.

const VERTEX = `#version 300 es
in vec2 corner;
out vec2 place;
void main() { place = corner; gl_Position = vec4(corner, 0.0, 1.0); }`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler3D;
uniform sampler3D volume;
uniform sampler2D colors, rates;
uniform vec3 right, up, towards, axis, low, high, nodes;
uniform float halfWidth, rMax, holeRadius, elapsed, threshold, white, rateCount;
in vec2 place;
out vec4 color;

float rate(float r) {
  float at = clamp(r / rMax, 0.0, 1.0) * (rateCount - 1.0);
  int first = int(min(floor(at), rateCount - 2.0));
  float a = texelFetch(rates, ivec2(first, 0), 0).r;
  float b = texelFetch(rates, ivec2(first + 1, 0), 0).r;
  return mix(a, b, at - float(first));
}

// Position at the reference time of the matter that is now at a point.
vec3 pulledBack(vec3 p) {
  float angle = -rate(length(p)) * elapsed;
  float s = sin(angle), c = cos(angle);
  return p * c + cross(axis, p) * s + axis * dot(axis, p) * (1.0 - c);
}

float emission(vec3 p) {
  vec3 q = (pulledBack(p) - low) / (high - low);
  if (any(lessThan(q, vec3(0.0))) || any(greaterThan(q, vec3(1.0)))) return 0.0;
  float value = texture(volume, (q * (nodes - 1.0) + 0.5) / nodes).r;
  return value < threshold ? 0.0 : value;
}

float light(vec3 start, float chord, float ball) {
  float far = ball > 0.0 ? sqrt(ball) : -chord;
  float steps = ceil(160.0 * (chord - far) / (2.0 * rMax));
  float ds = (chord - far) / steps;
  float sum = 0.0;
  for (float k = 0.5; k < steps; k += 1.0) sum += emission(start + (far + k * ds) * towards);
  return sum * ds;
}

void main() {
  vec3 start = (place.x * right + place.y * up) * halfWidth;
  float rho = dot(start, start), chord = rMax * rMax - rho, ball = holeRadius * holeRadius - rho;
  float part = chord > 0.0 ? light(start, sqrt(chord), ball) / white : 0.0;
  vec3 shine = texture(colors, vec2(clamp(part, 0.0, 1.0), 0.5)).rgb;
  vec3 ground = ball > 0.0 ? vec3(26.0, 30.0, 40.0) / 255.0 : vec3(0.0);
  color = vec4(max(shine, ground), 1.0);
}`;

function compile(gl, kind, source) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
  return shader;
}

function link(gl) {
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl, gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, compile(gl, gl.FRAGMENT_SHADER, FRAGMENT));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  return program;
}

// Name of the graphics driver, as the browser reports it.
function rendererName(gl) {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? "");
}

// Name of a software rasteriser that stands in for the GPU; empty with a real GPU.
function softwareName(name) {
  return name.match(/swiftshader|llvmpipe|softpipe|software|basic render/i)?.[0] ?? "";
}

function bindTexture(gl, target, slot, filter) {
  gl.activeTexture(gl.TEXTURE0 + slot);
  gl.bindTexture(target, gl.createTexture());
  for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) {
    gl.texParameteri(target, side, gl.CLAMP_TO_EDGE);
  }
  gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, filter);
  gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, filter);
}

// Texture units: 0 for the colour map, 1 for angular velocities, 2 and above for volumes.
function uploadTextures(gl, scene) {
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const colors = scene.colors.length / 3;
  bindTexture(gl, gl.TEXTURE_2D, 0, gl.LINEAR);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, colors, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, scene.colors);
  bindTexture(gl, gl.TEXTURE_2D, 1, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, RATES, 1, 0, gl.RED, gl.FLOAT, scene.rateTable);
  scene.volumes.forEach((volume, k) => {
    const [nx, ny, nz] = volume.nodes;
    bindTexture(gl, gl.TEXTURE_3D, 2 + k, gl.LINEAR);
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.R8, nx, ny, nz, 0, gl.RED, gl.UNSIGNED_BYTE, volume.bytes);
  });
}

function uploadCorners(gl, program) {
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
  const corner = gl.getAttribLocation(program, "corner");
  gl.enableVertexAttribArray(corner);
  gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
}

function gpuUniforms(scene, state, white) {
  const volume = scene.volumes[state.volume];
  return {
    ...cameraFrame(state),
    axis: scene.axis,
    low: volume.low,
    high: volume.high,
    nodes: volume.nodes,
    halfWidth: halfWidth(scene, state),
    rMax: scene.rMax,
    holeRadius: scene.holeRadius,
    elapsed: elapsed(scene, state),
    threshold: state.threshold,
    white: white / scene.scale,
    rateCount: RATES,
  };
}

function setUniforms(gl, program, uniforms) {
  for (const [name, value] of Object.entries(uniforms)) {
    const place = gl.getUniformLocation(program, name);
    if (Array.isArray(value)) gl.uniform3fv(place, value);
    else gl.uniform1f(place, value);
  }
}

// Renderer that draws on a canvas; null without WebGL2.
function gpuRenderer(canvas, scene) {
  const gl = canvas.getContext("webgl2", { alpha: false, preserveDrawingBuffer: true });
  if (!gl) return null;
  const program = link(gl);
  uploadTextures(gl, scene);
  uploadCorners(gl, program);
  for (const [name, slot] of [["colors", 0], ["rates", 1]]) {
    gl.uniform1i(gl.getUniformLocation(program, name), slot);
  }
  const draw = (state, white) => {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.uniform1i(gl.getUniformLocation(program, "volume"), 2 + state.volume);
    setUniforms(gl, program, gpuUniforms(scene, state, white));
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    const error = gl.getError();
    if (error !== gl.NO_ERROR && !gl.isContextLost()) throw new Error(`WebGL error ${error}`);
  };
  // Waits until the GPU has finished.
  const finish = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  return { draw, finish, by: rendererName(gl) };
}
