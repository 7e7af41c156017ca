// What all other files use: elements, numbers in words, images, colours, and the state of the page.

const read = (id) => JSON.parse(document.getElementById(id).textContent);

// Text from files becomes text nodes and attributes, never markup.
function build(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "style") Object.assign(node.style, value);
    else if (typeof value === "boolean") node[name] = value;
    else node.setAttribute(name, value);
  }
  for (const child of children.flat()) if (child !== null && child !== undefined) node.append(child);
  return node;
}
const el = (tag, attributes, ...children) => build(document.createElement(tag), attributes, children);
const svg = (tag, attributes, ...children) =>
  build(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);

const MINUS = "\u2212";
const fixed = (value, digits) =>
  value === null || value === undefined || !Number.isFinite(value) ? "\u2013"
    : (Number(value.toFixed(digits)) + 0 || 0).toFixed(digits).replace("-", MINUS);
// The least of 1, 2 and 5 times a power of ten that is not below a length.
const roundStep = (wanted) => {
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= wanted * (1 - 1e-9));
};
const digitsOf = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
const placeDigits = () => state.content.digits;
const placeText = (value) => fixed(value, placeDigits());
const metres = (value) => `${placeText(value)} m`;
const decibel = (value, lowest) =>
  Number.isFinite(value) ? `${value <= lowest ? "\u2264 " : ""}${fixed(value, 1)} dB` : "nothing";
const bouncesText = (n) => (n === 0 ? "in line of sight" : n === 1 ? "1 bounce" : `${n} bounces`);

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}
const floatsOf = (base64) => new Float32Array(bytesOf(base64).buffer);

async function inflate(base64) {
  const stream = new Blob([bytesOf(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Rows were stored as differences: the running sum, modulo 256, restores them.
async function levelsOf(packed, columns) {
  const bytes = await inflate(packed.data);
  for (let i = 0; i < bytes.length; i++) if (i % columns) bytes[i] = (bytes[i] + bytes[i - 1]) & 255;
  return { bytes, lowest: packed.lowest, step: packed.step };
}

async function unpack(document_) {
  const { nx } = document_.grid;
  const images = {};
  for (const [name, packed] of Object.entries(document_.images)) images[name] = await levelsOf(packed, nx);
  const points = { ...document_.points };
  for (const [name, held] of Object.entries(points)) {
    if (typeof held !== "string") continue;
    points[name] = points.doubles.includes(name) ? new Float64Array(bytesOf(held).buffer) : floatsOf(held);
  }
  // What people call it; the live page counts its lines.
  for (const mirror of document_.mirrors) mirror.name = String(mirror.number);
  const number = new Map(document_.mirrors.map((mirror) => [mirror.chain, mirror.number]));
  // The mirrors on the way of each chain, from the radar on.
  points.ways = points.chains.map((chain) => {
    const parts = chain === "" ? [] : chain.split("/");
    return parts.map((_, i) => number.get(parts.slice(0, i + 1).join("/"))).filter((n) => n !== undefined);
  });
  // The wall that each point has passed through, if it has.
  points.passed = Array.from(points.wall, (wall) => number.get(points.walls[wall]));
  return { ...document_, images, points };
}

function levelAt(image, grid, x, y) {
  const i = Math.round((x - grid.x0) / grid.dx), j = Math.round((y - grid.y0) / grid.dy);
  if (i < 0 || j < 0 || i >= grid.nx || j >= grid.ny) return undefined;
  const count = image.bytes[j * grid.nx + i];
  return count ? image.lowest + (count - 1) * image.step : -Infinity;
}

// Perceptually uniform maps: Matplotlib's viridis, magma and cividis, and plain lightness.
const MAPS = {
  grey: null,
  viridis: "440154481f704439833b528b31688e287c8e21918c20a48635b7795ec96290d743c8e020fde725",
  magma: "000004100b2d2c115f51127c721f81932b80b73779d8456cf1605dfc8961feb078fed799fcfdbf",
  cividis: "00224e0031702a3f6d434e6c575d6d6a6c717d7c78918b78a59c74bcae6cd2c060e9d34efee838",
};
function mapColour(name, t, dark) {
  if (!MAPS[name]) {
    // Equal steps of lightness L* of grey, dark on light paper and light on dark.
    const lightness = dark ? 2 + 98 * t : 100 - 97 * t;
    const f = (lightness + 16) / 116;
    const linear = lightness > 8 ? f ** 3 : lightness / 903.3;
    const value = 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055);
    return [value, value, value];
  }
  const stops = MAPS[name];
  const place = t * (stops.length / 6 - 1), k = Math.min(Math.floor(place), stops.length / 6 - 2), rest = place - k;
  return [0, 1, 2].map((c) => {
    const at = (i) => parseInt(stops.slice(6 * i + 2 * c, 6 * i + 2 * c + 2), 16);
    return at(k) + rest * (at(k + 1) - at(k));
  });
}

const state = {
  content: null, floor: -40, map: "grey", swipe: 0.5, flip: false, mode: "swipe", lit: null, spot: null, confidence: 0,
  hidden: new Set(), show: { points: true, mirrors: true, shadows: true, truth: true }, view: null, dark: false,
};
const painters = [];
let waiting = false;
// Draw everything once, at the next frame, however often the state has changed.
function changed() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; for (const paint of painters) paint(); });
}
function light(number) { if (state.lit !== number) { state.lit = number; changed(); } }
// What stands for a mirror lights it: while it is pointed at or has the focus, and after a tap, until the next one.
const lights = (number) => ({
  onpointerenter: () => light(number), onpointerleave: (event) => { if (event.pointerType !== "touch") light(null); },
  onclick: (event) => { light(number); event.stopPropagation(); }, onfocus: () => light(number), onblur: () => light(null),
});
// Follow the pointer that was pressed, wherever it goes, until it is lifted or a second finger joins it, for two zoom.
function followPointer(pressed, act, end = () => {}) {
  const own = (event) => event.pointerId === pressed.pointerId, ends = ["pointerup", "pointercancel", "pointerdown"];
  const move = (event) => { if (own(event)) act(event); };
  const stop = (event) => {
    if (own(event) === (event.type === "pointerdown")) return;
    window.removeEventListener("pointermove", move);
    for (const name of ends) window.removeEventListener(name, stop, true);
    end();
  };
  window.addEventListener("pointermove", move);
  for (const name of ends) window.addEventListener(name, stop, true);
}
// Whether a press begins to drag: neither that of a second finger, nor that of another button of the mouse.
const drags = (event) => event.isPrimary && event.button === 0;
// Two fingers on a node: by what factor they spread, where they are, and how far they moved. One finger scrolls the page.
function pinched(node, act) {
  let last = null;
  const follow = (event) => {
    if (event.touches.length !== 2) { last = null; return; }
    event.preventDefault();
    const [a, b] = event.touches, box = node.getBoundingClientRect();
    const now = { x: (a.clientX + b.clientX) / 2 - box.left, y: (a.clientY + b.clientY) / 2 - box.top,
      apart: Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) };
    if (last) act(now.apart / Math.max(last.apart, 1), [now.x, now.y], [now.x - last.x, now.y - last.y]);
    last = now;
  };
  for (const name of ["touchstart", "touchmove", "touchend", "touchcancel"]) node.addEventListener(name, follow, { passive: false });
}
const touched = matchMedia("(pointer: coarse)").matches;
const colourOf = (bounces) => state.content.colours[bounces % state.content.colours.length];
// All colour maps but grey are dark at their floor, whatever the paper.
const darkStage = () => state.dark || state.map !== "grey";
const truthColour = () => (darkStage() ? "#ff5c50" : state.content.truth_colour);
const mirrorColour = (mirror) => colourOf(mirror.generation - 1);

// What points are marked by: the number of bounces, or that they have passed through a wall.
const PASSED = "passed";
const kindOf = (points, i) => (points.passed[i] === undefined ? points.bounces[i] : PASSED);
const kindColour = (kind) => (kind === PASSED ? state.content.passed.colour : colourOf(kind));
const kindText = (kind) => (kind === PASSED ? state.content.passed.label : bouncesText(kind));
function pointShown(points, i) {
  return points.confidence[i] >= Math.fround(state.confidence) && !state.hidden.has(kindOf(points, i));
}
const pointLit = (points, i) => state.lit === null || points.ways[points.chain[i]].includes(state.lit);

function theme(dark) {
  state.dark = dark;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  changed();
}
