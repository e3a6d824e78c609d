// What the page shows: the scene that stands in it, and the view that its address holds.
"use strict";

const $ = name => document.getElementById(name);
const GIVEN = JSON.parse($("given").textContent);
const SCENE = GIVEN.scene;

const bytesOf = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));

const NUMBERS = {
  spin: [-0.999, 0.999], inclination: [0.5, 179.5], azimuth: [-1e9, 1e9], radius: [2.1, 2000], field: [0.1, 20000],
  angle: [1, 160], time: [-1e9, 1e9], exposure: [-8, 8], cut: [-100, 100],
};
const SWITCHES = ["lensing", "redshift", "slow", "disc", "volume", "spots", "sky", "curve"];
const PANELS = GIVEN.volumes.length > 1 ? ["recovered", "truth"] : ["recovered"];
if (GIVEN.data) PANELS.push("data");

function startState() {
  const { effects, camera, observer, hole } = SCENE;
  const state = {
    kind: camera ? "camera" : "screen", spin: hole.spin, time: observer.time, exposure: 0, cut: 0, slice: "none",
    lensing: +effects.lensing, redshift: +effects.redshift, slow: +effects.slow_light, disc: 1, volume: 1, spots: 1, sky: 1,
    curve: 0, panels: PANELS.join("+"), pick: "", yaw: 0, pitch: 0, roll: 0,
  };
  const pose = GIVEN.pose;
  if (pose) {
    const [radius, inclination, azimuth, angle, yaw, pitch, roll] = pose;
    return Object.assign(state, { radius, inclination, azimuth, angle, yaw, pitch, roll, field: 30 });
  }
  const { inclination_deg: inclination, azimuth_deg: azimuth } = observer;
  return Object.assign(state, { inclination, azimuth, field: GIVEN.field, radius: 40, angle: 2 * Math.atan(GIVEN.field / 80) / RADIANS });
}

const state = startState();

// Numbers stay in their ranges, a view whose spin or inclination stands at an end of them exactly there.
function clamp() {
  const home = startState();
  const { outer } = horizons(state.spin);
  for (const [name, [least, most]] of Object.entries(NUMBERS)) {
    const low = name === "radius" ? Math.max(Math.min(least, home.radius), 1.05 * outer) : Math.min(least, home[name]);
    state[name] = Math.min(Math.max(most, home[name]), Math.max(low, state[name]));
  }
  if (GIVEN.times) state.time = Math.min(GIVEN.times[1], Math.max(GIVEN.times[0], state.time));
}

function readLink() {
  for (const [name, value] of new URLSearchParams(location.hash.slice(1))) {
    if (!(name in state)) continue;
    if (typeof state[name] === "number") { if (value !== "" && Number.isFinite(+value)) state[name] = +value; }
    else if (name === "kind") { if (["camera", "screen"].includes(value)) state.kind = value; }
    else if (name === "slice") { if (["none", "x", "y", "z"].includes(value)) state.slice = value; }
    else if (name === "panels") state.panels = value.split(/[+ ]/).filter(panel => PANELS.includes(panel)).join("+") || state.panels;
    else if (name === "pick") { if (/^-?[\d.e-]+,-?[\d.e-]+$/.test(value)) state.pick = value; }
  }
  clamp();
}

// What differs from the view that the scene has by itself.
function writeLink() {
  const home = startState(), link = new URLSearchParams();
  for (const [name, value] of Object.entries(state)) {
    if (value !== home[name]) link.set(name, typeof value === "number" ? String(+value.toPrecision(8)) : value);
  }
  history.replaceState(null, "", `#${link}`);
}

const isCamera = () => state.kind === "camera";
const panels = () => state.panels.split("+").filter(panel => PANELS.includes(panel));
const theta = () => Math.min(Math.max(state.inclination, 1e-4), 180 - 1e-4) * RADIANS;
const cameraSetup = () => ({ motion: GIVEN.motion, axes: cameraAxes(state.yaw * RADIANS, state.pitch * RADIANS, state.roll * RADIANS) });

// Half of the field across the shorter side: M, or on the picture plane at distance 1.
const halfField = () => (isCamera() ? Math.tan(0.5 * state.angle * RADIANS) : 0.5 * state.field);

const quoted = text => (/^[\w.\/=:+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

// The command that renders a panel, `width` by `height` pixels; null for drawings that no command makes: the scene is that of
// what was recovered, and spots are never rendered without lensing.
function command(width, height, panel = panels().find(panel => panel !== "data")) {
  if (panel !== "recovered" || state.slice !== "none") return null;
  if (!state.lensing && (isCamera() || (state.spots && GIVEN.keys.includes("spot")))) return null;
  const across = 2 * halfField() * width / Math.min(width, height), short = x => +x.toPrecision(12);
  const set = { "hole.spin": short(state.spin), "observer.time": short(state.time), "screen.width": width, "screen.height": height };
  const pose = { radius: short(state.radius), theta_deg: short(state.inclination), phi_deg: short(state.azimuth), field_of_view_deg: short(2 * Math.atan(across / 2) / RADIANS), yaw_deg: short(state.yaw), pitch_deg: short(state.pitch), roll_deg: short(state.roll) };
  const remove = ["screen.total_flux_jy", "screen.image_error"];
  if (isCamera()) {
    set.camera = `{motion="${GIVEN.motion}",${Object.entries(pose).map(([key, x]) => `${key}=${x}`)}}`;
    remove.push("observer.inclination_deg", "observer.azimuth_deg", "observer.radius", "screen.field_of_view_m", "screen.field_of_view_uas");
  } else {
    Object.assign(set, { "observer.inclination_deg": short(state.inclination), "observer.azimuth_deg": short(state.azimuth), "screen.field_of_view_m": short(across) });
    remove.push("camera", "screen.field_of_view_uas");
  }
  // Drawings without lensing have neither delays nor shifts.
  Object.assign(set, { "effects.lensing": !!state.lensing, "effects.slow_light": !!(state.slow && state.lensing) });
  if (SCENE.effects.redshift) set["effects.redshift"] = !!(state.redshift && state.lensing);
  for (const [key, on] of [["disc", state.disc], ["sky", state.sky], ["spot", state.spots], ["volume", state.volume]]) if (!on) remove.push(key);
  // Neither is drawn along straight rays.
  if (!state.lensing) remove.push(...["disc", "gas", "sky"].filter(key => !remove.includes(key)));
  const words = [...remove.filter(key => GIVEN.keys.includes(key)).map(key => `${key}=`), ...Object.entries(set).map(([key, value]) => `${key}=${value}`)];
  return `kerrlight render ${[...GIVEN.words, "-o", "view.exr"].map(quoted).join(" ")} ${words.map(word => `--set ${quoted(word)}`).join(" ")}`;
}
