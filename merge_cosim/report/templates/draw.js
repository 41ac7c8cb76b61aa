// Helpers that every drawing shares: SVG elements, scales, ticks, looks of methods.
const DATA = JSON.parse(document.getElementById("data").textContent);
const METHODS = DATA.methods;
const themed = [];
const darkSystem = matchMedia("(prefers-color-scheme: dark)");
const isDark = () => (document.documentElement.dataset.theme || (darkSystem.matches ? "dark" : "light")) === "dark";
const all = (selector, root = document) => [...root.querySelectorAll(selector)];
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

function svg(name, attributes = {}, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

function html(name, attributes = {}, text) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

// The colour of a method as a style; the page's theme lightens it.
const look = (method) => `--m:${METHODS[method]?.color || "{{ colors.GREY }}"}`;
const dash = (method) => METHODS[method]?.dash || "";

// Shapes of methods around (0, 0), by matplotlib's signs.
const ring = (count, radii, turn = -90) => `M${Array.from({ length: count }, (_, i) => { const a = ((turn + (i * 360) / count) * Math.PI) / 180, r = radii[i % radii.length]; return `${(r * Math.cos(a)).toFixed(2)} ${(r * Math.sin(a)).toFixed(2)}`; }).join("L")}Z`;
const PLUS = "M-.35-1H.35V-.35H1V.35H.35V1H-.35V.35H-1V-.35H-.35Z";
const SHAPES = { s: ring(4, [1.2], 45), "^": ring(3, [1.3]), v: ring(3, [1.3], 90), D: ring(4, [1.25]), P: PLUS, X: PLUS, "*": ring(10, [1.45, 0.62]), p: ring(5, [1.15]), h: ring(6, [1.15]) };

function marker(method, x, y, radius = 4, attributes = {}) {
  const kind = METHODS[method]?.mark || "o";
  const place = `translate(${x.toFixed(1)} ${y.toFixed(1)}) scale(${radius})${kind === "X" ? " rotate(45)" : ""}`;
  const shape = { class: "dot", ...attributes, transform: place, "vector-effect": "non-scaling-stroke" };
  return kind === "o" ? svg("circle", { ...shape, r: 1 }) : svg("path", { ...shape, d: SHAPES[kind] });
}

// A method's shape beside its name.
function swatch(method) {
  const root = svg("svg", { class: "swatch m", style: look(method), viewBox: "-8 -8 16 16", width: 13, height: 13, "aria-hidden": "true" });
  root.append(marker(method, 0, 0, 6, { class: `dot${METHODS[method]?.reference ? " hollow" : ""}` }));
  return root;
}

function scale(low, high, from, to) {
  const slope = (to - from) / (high - low || 1);
  const place = (value) => from + (value - low) * slope;
  place.invert = (pixel) => low + (pixel - from) / slope;
  return place;
}

function ticks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1) || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((one) => one * power >= rough) * power;
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) found.push(+(i * step).toPrecision(12));
  return found;
}

const written = (value) => String(value).replace("-", "−");

// A frame with grid, ticks and labels; returns the drawing and both scales.
function frame(width, height, x, y, options = {}) {
  const margin = { left: 46, right: 12, top: 10, bottom: 36, ...options.margin };
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": options.label || "" });
  const sx = scale(x[0], x[1], margin.left, width - margin.right);
  const sy = scale(y[0], y[1], height - margin.bottom, margin.top);
  for (const value of options.yTicks || ticks(y[0], y[1], height / 45)) {
    root.append(svg("line", { class: "grid", x1: margin.left, x2: width - margin.right, y1: sy(value), y2: sy(value) }));
    const text = options.yNames ? options.yNames[value] : written(value);
    root.append(svg("text", { class: "tick", x: margin.left - 5, y: sy(value) + 4, "text-anchor": "end" }, text));
  }
  for (const [i, value] of (options.xTicks || ticks(x[0], x[1], width / 80)).entries()) {
    root.append(svg("line", { class: "grid", x1: sx(value), x2: sx(value), y1: margin.top, y2: height - margin.bottom }));
    const text = options.xNames ? options.xNames[i] : written(value);
    root.append(svg("text", { class: "tick", x: sx(value), y: height - margin.bottom + 14, "text-anchor": "middle" }, text));
  }
  root.append(svg("line", { class: "axis", x1: margin.left, x2: width - margin.right, y1: height - margin.bottom, y2: height - margin.bottom }));
  const middle = (margin.left + width - margin.right) / 2;
  if (options.xLabel) root.append(svg("text", { x: middle, y: height - 4, "text-anchor": "middle" }, options.xLabel));
  if (options.yLabel) {
    const at = (margin.top + height - margin.bottom) / 2;
    root.append(svg("text", { x: 12, y: at, "text-anchor": "middle", transform: `rotate(-90 12 ${at})` }, options.yLabel));
  }
  return { root, sx, sy, margin, width, height };
}

// Draw into an element now, and again whenever its width changes or it is unfolded.
function drawn(element, draw) {
  let last = 0;
  new ResizeObserver(() => {
    const width = Math.round(element.clientWidth);
    if (width < 40 || width === last) return;
    last = width;
    draw(width);
    applyFilter();
  }).observe(element);
}

// Move labels apart that would lie over each other; items have y and height, and stay within low ... high.
function spread(items, low, high) {
  items.sort((a, b) => a.y - b.y);
  let floor = low;
  for (const item of items) { item.y = Math.max(item.y, floor); floor = item.y + item.height; }
  let roof = high;
  for (const item of [...items].reverse()) { item.y = Math.min(item.y, roof); roof = item.y - item.height; }
  return items;
}
