// Small multiples on canvases: failure maps by both initial speeds, and delays against ambiguity.
const HEAT = {
  light: [[255, 247, 205], [254, 217, 118], [253, 160, 70], [240, 80, 45], [190, 10, 40], [100, 0, 40]],
  dark: [[44, 38, 40], [98, 36, 54], [160, 40, 50], [220, 80, 50], [250, 160, 70], [255, 240, 180]],
};
const heats = () => HEAT[isDark() ? "dark" : "light"];
const heat = (share) => {
  const steps = heats(), place = clamp(share, 0, 1) * (steps.length - 1), i = Math.min(Math.floor(place), steps.length - 2), part = place - i;
  return `rgb(${steps[i].map((from, k) => Math.round(from + part * (steps[i + 1][k] - from)))})`;
};
const inkOn = (share) => (share > 0.55 === isDark() ? "#222" : "#fff");
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function panels(element, methods, draw) {
  if (methods.length < 7) element.classList.add(methods.length < 3 ? "few" : "some");
  for (const method of methods) {
    const box = html("div", { class: "map", "data-method": method });
    const canvas = html("canvas", { role: "img" });
    const heading = html("h3", {}, ` ${method}`);
    heading.prepend(swatch(method));
    box.append(heading, canvas);
    element.append(box);
    drawn(box, (width) => draw(method, canvas, width));
    themed.push(() => box.clientWidth > 40 && draw(method, canvas, box.clientWidth));
  }
}

function prepared(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  canvas.style.height = `${height}px`;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.font = "11px system-ui, sans-serif";
  return pen;
}

function failureMaps(element, map, cases, readout) {
  const methods = Object.keys(map.n), rows = map.hosts.length, columns = map.mergings.length;
  const share = (method, i) => map.failed[method][i] / map.n[method][i];
  const top = Math.max(0.01, ...methods.flatMap((method) => map.n[method].map((n, i) => (n ? share(method, i) : 0))));
  const nearest = (values, value) => values.reduce((best, one, i) => (Math.abs(one - value) < Math.abs(values[best] - value) ? i : best), 0);
  const recorded = new Map();
  for (const number of cases) {
    const one = DATA.cases[number];
    if (one.host_speed === null) continue;
    const cell = nearest(map.hosts, one.host_speed) * columns + nearest(map.mergings, one.merging_speed);
    recorded.set(cell, [...(recorded.get(cell) || []), number]);
  }
  const cursor = {};
  const borders = (values) => {
    const half = values.length > 1 ? (values[1] - values[0]) / 2 : 0.5;
    return [values[0] - half, values.at(-1) + half];
  };
  const layout = (width) => {
    const left = 44, bottom = 30, height = Math.round(Math.min(width - left, 340)) + bottom;
    return { left, bottom, height, cellWidth: (width - left - 2) / columns, cellHeight: (height - bottom - 2) / rows };
  };
  const draw = (method, canvas, width) => {
    const { left, bottom, height, cellWidth, cellHeight } = layout(width), pen = prepared(canvas, width, height);
    const at = (i) => [left + (i % columns) * cellWidth, height - bottom - (Math.floor(i / columns) + 1) * cellHeight];
    map.n[method].forEach((n, i) => {
      const [x, y] = at(i);
      if (!n) return;
      pen.fillStyle = heat(share(method, i) / top);
      pen.fillRect(Math.floor(x), Math.floor(y), Math.ceil(x + cellWidth) - Math.floor(x), Math.ceil(y + cellHeight) - Math.floor(y));
      if (cellWidth > 34 && cellHeight > 18) {
        pen.fillStyle = inkOn(share(method, i) / top);
        pen.textAlign = "center";
        pen.fillText(`${Math.round(100 * share(method, i))} %`, x + cellWidth / 2, y + cellHeight / 2 + 4);
      }
      if (map.absent[method][i]) {
        pen.fillStyle = inkOn(share(method, i) / top);
        pen.beginPath();
        pen.arc(x + cellWidth / 2, y + (cellHeight > 30 ? cellHeight * 0.82 : cellHeight / 2), Math.max(1, Math.min(cellWidth, cellHeight) / 6, 0), 0, 7);
        if (cellWidth > 34) { pen.beginPath(); pen.arc(x + cellWidth / 2, y + cellHeight * 0.84, 3, 0, 7); }
        pen.fill();
      }
    });
    pen.lineWidth = 2;
    for (const i of recorded.keys()) {
      const [x, y] = at(i), r = Math.max(5, Math.min(cellWidth, cellHeight, 60) / 2 - 1);
      pen.strokeStyle = colour("--link");
      pen.beginPath();
      pen.arc(x + cellWidth / 2, y + cellHeight / 2, r, 0, 7);
      pen.stroke();
    }
    if (cursor.method === method) {
      const [x, y] = at(cursor.cell);
      pen.strokeStyle = colour("--ink");
      pen.strokeRect(x, y, cellWidth, cellHeight);
    }
    pen.fillStyle = colour("--soft");
    const [x0, x1] = borders(map.mergings), [y0, y1] = borders(map.hosts);
    const sx = scale(x0, x1, left, left + columns * cellWidth), sy = scale(y0, y1, height - bottom, height - bottom - rows * cellHeight);
    pen.textAlign = "center";
    for (const value of columns < 6 ? map.mergings : ticks(x0, x1, 4)) pen.fillText(written(value), sx(value), height - bottom + 12);
    pen.fillText("merging car m/s", left + (width - left) / 2, height - 4);
    pen.textAlign = "right";
    for (const value of rows < 6 ? map.hosts : ticks(y0, y1, 4)) pen.fillText(written(value), left - 4, sy(value) + 4);
    pen.save();
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText("host m/s", -(height - bottom) / 2, 10);
    pen.restore();
    const failed = map.failed[method].reduce((a, b) => a + b, 0), n = map.n[method].reduce((a, b) => a + b, 0);
    canvas.setAttribute("aria-label", `${method}: ${failed} of ${n} cases failed; arrow keys tell each cell`);
  };
  panels(element, methods, draw);
  for (const box of all(".map", element)) {
    const canvas = box.querySelector("canvas"), method = box.dataset.method;
    canvas.tabIndex = 0;
    const move = (cell) => {
      const before = cursor.method;
      Object.assign(cursor, { method, cell });
      for (const other of all(".map", element)) if ([before, method].includes(other.dataset.method)) draw(other.dataset.method, other.querySelector("canvas"), other.clientWidth);
      const n = map.n[method][cell], here = recorded.get(cell);
      const stuck = map.absent[method][cell] ? `, ${map.absent[method][cell]} never arrived` : "";
      readout.textContent = `${method}: host ${map.hosts[Math.floor(cell / columns)]} m/s, merging car ${map.mergings[cell % columns]} m/s: ` + (n ? `${map.failed[method][cell]} of ${n} failed${stuck}` : "no case") + (here ? "; recorded: click or Enter to watch" : "");
      canvas.style.cursor = here ? "pointer" : "default";
    };
    const cellAt = (event) => {
      const area = canvas.getBoundingClientRect(), { left, bottom, height, cellWidth, cellHeight } = layout(box.clientWidth);
      const column = Math.floor((event.clientX - area.left - left) / cellWidth), row = Math.floor((height - bottom - (event.clientY - area.top)) / cellHeight);
      return column >= 0 && column < columns && row >= 0 && row < rows ? row * columns + column : null;
    };
    const watch = () => recorded.has(cursor.cell) && openViewer(recorded.get(cursor.cell)[0], method);
    canvas.addEventListener("pointermove", (event) => { const cell = cellAt(event); if (cell !== null) move(cell); });
    canvas.addEventListener("click", (event) => { const cell = cellAt(event); if (cell !== null) { move(cell); watch(); } });
    canvas.addEventListener("keydown", (event) => {
      const steps = { ArrowRight: 1, ArrowLeft: -1, ArrowUp: columns, ArrowDown: -columns };
      if (event.key === "Enter") return watch();
      if (!(event.key in steps)) return;
      event.preventDefault();
      const from = cursor.method === method ? cursor.cell : [...recorded.keys()][0] ?? 0;
      move(clamp(from + (cursor.method === method ? steps[event.key] : 0), 0, rows * columns - 1));
    });
  }
  const bar = html("p", { class: "scale" });
  const stripe = html("i"), paint = () => { stripe.style.background = `linear-gradient(to right, ${heats().map((rgb) => `rgb(${rgb})`).join(",")})`; };
  paint();
  themed.push(paint);
  if (methods.some((method) => map.failed[method].some(Boolean))) bar.append("0 %", stripe, `${Math.round(1000 * top) / 10} % of the cases failed`);
  else bar.append("No case failed.");
  element.append(bar);
}

function delayDots(element, data) {
  const methods = Object.keys(data.methods);
  const quantile = (values, q) => [...values].sort((a, b) => a - b)[Math.floor((values.length - 1) * q)] ?? 1;
  const xs = methods.flatMap((method) => data.methods[method].x);
  const ys = methods.filter((method) => !METHODS[method].reference || methods.length < 3).flatMap((method) => data.methods[method].y.filter((value) => value !== null));
  const right = Math.max(quantile(xs, 0.95), data.edges.at(-1)) * 1.1, topEnd = Math.max(quantile(ys, 0.95) * 1.15, 1), low = Math.min(0, quantile(ys, 0.01));
  const most = Math.max(...methods.map((method) => data.methods[method].x.length)), size = clamp(5 - Math.log10(most), 2.2, 4);
  panels(element, methods, (method, canvas, width) => {
    const left = 36, bottom = 30, height = Math.round(Math.min(width, 300)), pen = prepared(canvas, width, height), own = data.methods[method];
    const sx = scale(0, right, left, width - 6), sy = scale(low, topEnd, height - bottom, 8);
    pen.strokeStyle = colour("--grid");
    for (const edge of data.edges) { pen.beginPath(); pen.moveTo(sx(edge), 8); pen.lineTo(sx(edge), height - bottom); pen.stroke(); }
    pen.beginPath(); pen.moveTo(left, sy(0)); pen.lineTo(width - 6, sy(0)); pen.stroke();
    pen.fillStyle = colour("--soft");
    pen.textAlign = "center";
    for (const value of ticks(0, right, 4)) pen.fillText(written(value), sx(value), height - bottom + 12);
    pen.fillText("|T_m − T_h| s", (left + width) / 2, height - 4);
    pen.textAlign = "right";
    for (const value of ticks(low, topEnd, 4)) pen.fillText(written(value), left - 4, sy(value) + 4);
    pen.save(); pen.rotate(-Math.PI / 2); pen.textAlign = "center"; pen.fillText("delay s", -(height - bottom) / 2, 10); pen.restore();
    const dot = getComputedStyle(canvas.parentElement.appendChild(probe(method))).color;
    canvas.parentElement.lastChild.remove();
    let failures = 0;
    own.x.forEach((value, i) => {
      if (own.failed[i] || own.y[i] === null) return;
      const beyond = value > right || own.y[i] > topEnd, x = sx(Math.min(value, right)), y = sy(clamp(own.y[i], low, topEnd));
      pen.fillStyle = dot;
      pen.globalAlpha = most > 100 ? 0.45 : 0.75;
      pen.beginPath();
      if (beyond) { pen.moveTo(x, y - 4); pen.lineTo(x + 4, y + 3); pen.lineTo(x - 4, y + 3); } else pen.arc(x, y, size, 0, 7);
      pen.fill();
    });
    pen.globalAlpha = 1;
    pen.strokeStyle = colour("--fail");
    pen.lineWidth = 1.6;
    own.x.forEach((value, i) => {
      if (!own.failed[i]) return;
      failures++;
      const x = sx(Math.min(value, right)), y = sy(clamp(own.y[i] ?? 0, low, topEnd));
      pen.beginPath(); pen.moveTo(x - 4, y - 4); pen.lineTo(x + 4, y + 4); pen.moveTo(x - 4, y + 4); pen.lineTo(x + 4, y - 4); pen.stroke();
    });
    canvas.setAttribute("aria-label", `${method}: delays of ${own.x.length} cases, ${failures} failed`);
  });
}

const probe = (method) => html("span", { class: "m", style: `${look(method)};color:var(--c)` });
