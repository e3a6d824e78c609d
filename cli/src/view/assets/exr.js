// Pictures as files: OpenEXR without compression, 32-bit floats.
"use strict";

// The bytes of an EXR with the channels B, G, R and intensity from light of four floats a pixel, rows from above.
function exrBytes(light, width, height, comments) {
  const text = new TextEncoder(), parts = [];
  const put = (type, ...values) => {
    const view = new DataView(new ArrayBuffer(values.length * 4));
    values.forEach((value, k) => view[type](4 * k, value, true));
    parts.push(new Uint8Array(view.buffer));
  };
  const words = string => parts.push(text.encode(string));
  const attribute = (name, type, size) => { words(`${name}\0${type}\0`); put("setInt32", size); };
  const names = ["B", "G", "R", "intensity"], of = [2, 1, 0, 3];
  put("setInt32", 20000630, 2);
  attribute("channels", "chlist", names.reduce((sum, name) => sum + name.length + 17, 1));
  for (const name of names) { words(`${name}\0`); put("setInt32", 2, 0, 1, 1); }
  words("\0");
  const note = text.encode(comments);
  attribute("comments", "string", note.length); parts.push(note);
  attribute("compression", "compression", 1); words("\0");
  attribute("dataWindow", "box2i", 16); put("setInt32", 0, 0, width - 1, height - 1);
  attribute("displayWindow", "box2i", 16); put("setInt32", 0, 0, width - 1, height - 1);
  attribute("lineOrder", "lineOrder", 1); words("\0");
  attribute("pixelAspectRatio", "float", 4); put("setFloat32", 1);
  attribute("screenWindowCenter", "v2f", 8); put("setFloat32", 0, 0);
  attribute("screenWindowWidth", "float", 4); put("setFloat32", 1);
  words("\0");
  const start = parts.reduce((sum, part) => sum + part.length, 0) + 8 * height, line = 8 + 16 * width;
  for (let row = 0; row < height; row++) put("setUint32", start + row * line, 0);
  for (let row = 0; row < height; row++) {
    put("setInt32", row, 16 * width);
    const values = new Float32Array(4 * width);
    of.forEach((from, channel) => { for (let k = 0; k < width; k++) values[channel * width + k] = light[4 * (row * width + k) + from]; });
    parts.push(new Uint8Array(values.buffer));
  }
  return new Blob(parts);
}

function saveFile(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob); link.download = name; link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}
