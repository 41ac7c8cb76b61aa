// The trade-off chart and plots of lines with labels at their ends.
const TEXT_HEIGHT = 14;
const measuring = document.createElement("canvas").getContext("2d");
function textWidth(text, weight = 400) {
  measuring.font = `${weight} 12px ${getComputedStyle(document.body).fontFamily}`;
  return measuring.measureText(text).width + 6;
}

function tradeoff(element, rows, width) {
  const known = rows.filter((row) => row.bad_pct !== null && row.delay !== null);
  if (!known.length) { element.textContent = "No case could be scored."; return; }
  const height = clamp(width * 0.68, 320, 470 + 8 * Math.max(0, rows.length - 14));
  const rivals = known.filter((row) => !row.reference);
  const inside = rivals.length ? rivals : known;
  const ends = (low, value, high) => inside.flatMap((row) => [row[low], row[value], row[high]].filter((one) => one !== null));
  const delays = ends("delay_low", "delay", "delay_high"), shares = ends("bad_low", "bad_pct", "bad_high");
  const [left, right] = [Math.min(0, ...delays), Math.max(...delays, 0.1)];
  const x = [left, right + (right - left) * 0.2];
  const y = [0, Math.min(Math.max(...shares, 1) * 1.12, 104)];
  const f = frame(width, height, x, y, { xLabel: "mean delay [s]", yLabel: "failed or stuck [%]", label: "Failed or stuck against mean delay, a dot per method; the numbers are in the table" });
  const dots = known.map((row) => {
    const off = row.delay > x[1] || row.delay < x[0] || row.bad_pct > y[1];
    return { row, off, x: f.sx(clamp(row.delay, ...x)), y: f.sy(clamp(row.bad_pct, ...y)) };
  });
  const spans = [];
  for (const { row, off } of dots) {
    if (off) continue;
    const bar = (x1, x2, y1, y2) => spans.push([Math.min(x1, x2) - 1, Math.min(y1, y2) - 1, Math.max(x1, x2) + 1, Math.max(y1, y2) + 1]) && f.root.append(svg("line", { class: "span m", style: look(row.method), "data-method": row.method, x1, x2, y1, y2 }));
    if (row.bad_low !== null) bar(f.sx(row.delay), f.sx(row.delay), f.sy(Math.max(row.bad_low, y[0])), f.sy(Math.min(row.bad_high, y[1])));
    if (row.delay_low !== null) bar(f.sx(Math.max(row.delay_low, x[0])), f.sx(Math.min(row.delay_high, x[1])), f.sy(row.bad_pct), f.sy(row.bad_pct));
  }
  f.boxes = dots.map((dot) => [dot.x - 8, dot.y - 8, dot.x + 8, dot.y + 8]);
  f.spans = spans;
  for (const dot of dots) placeLabel(f, dot);
  for (const { row, off, x: px, y: py } of dots) {
    const shape = { class: `dot m pick${row.reference ? " hollow" : ""}`, style: look(row.method), "data-method": row.method, "data-watch": row.method };
    const turn = row.delay > x[1] ? 0 : row.delay < x[0] ? 180 : -90;
    const mark = off ? svg("path", { ...shape, d: "M-5 5L5 0L-5-5Z", transform: `translate(${px} ${py}) rotate(${turn})` }) : marker(row.method, px, py, row.best ? 7.5 : 5.5, shape);
    mark.append(svg("title", {}, `${row.method}: ${row.failed} failed, ${row.stuck} stuck of ${row.n}; delay ${row.delay.toFixed(2)} s`));
    f.root.append(mark);
  }
  element.replaceChildren(f.root);
}

// Put the name beside its dot where it covers neither another name nor a dot; further away with a thin line.
function placeLabel(f, dot, most = 99) {
  const { row, off } = dot;
  const name = row.method.length > most ? `${row.method.slice(0, most)}…` : row.method;
  const text = name + (row.best ? " ★" : "") + (off ? ` (${row.delay.toFixed(1)} s, ${row.bad_pct.toFixed(0)} %)` : "");
  const w = textWidth(text, row.best ? 650 : 400), h = TEXT_HEIGHT;
  let best = null;
  for (const reach of [10, 16, 22, 30, 44, 60, 80, 105, 135]) {
    for (let turn = 0; turn < 16; turn++) {
      const angle = (turn * Math.PI) / 8, cx = dot.x + reach * Math.cos(angle), cy = dot.y - reach * Math.sin(angle);
      const x0 = Math.abs(Math.cos(angle)) < 0.3 ? cx - w / 2 : Math.cos(angle) > 0 ? cx : cx - w;
      const box = [x0, cy - h / 2, x0 + w, cy + h / 2];
      if (box[0] < f.margin.left || box[2] > f.width - 2 || box[1] < 0 || box[3] > f.height - f.margin.bottom - 1) continue;
      const covered = (boxes) => boxes.reduce((sum, other) => sum + overlap(box, other), 0);
      const cost = reach + 20 * covered(f.boxes) + 0.3 * covered(f.spans);
      if (!best || cost < best.cost) best = { cost, box, cx, cy, reach };
    }
  }
  if (!best) return most > 12 ? placeLabel(f, dot, 12) : undefined;
  if (row.reference && best.cost > 400) return;
  f.boxes.push(best.box);
  if (best.reach > 22) {
    const end = [clamp(dot.x, best.box[0], best.box[2]), clamp(dot.y, best.box[1] + 3, best.box[3] - 3)];
    f.root.append(svg("line", { class: "lead-line", "data-method": row.method, x1: dot.x, y1: dot.y, x2: end[0], y2: end[1] }));
  }
  f.root.append(svg("text", { x: best.box[0] + 3, y: best.box[3] - 3, class: row.best ? "strong" : row.reference ? "label-ref" : "", "data-method": row.method }, text));
}

function overlap(a, b) {
  const w = Math.min(a[2], b[2]) - Math.max(a[0], b[0]), h = Math.min(a[3], b[3]) - Math.max(a[1], b[1]);
  return w > 0 && h > 0 ? w * h : 0;
}

// Lines with markers and names at their right ends. Series have name, x, y, and may have low and high.
function lines(element, series, width, options) {
  const shown = series.filter((one) => one.y.some((value) => value !== null));
  const names = shown.map((one) => one.name);
  const right = options.labels === false ? 12 : Math.min(Math.max(...names.map((name) => textWidth(name)), 20) + 18, width * 0.4);
  const height = options.height || Math.max(240, names.length * (options.labels === false ? 0 : 14) + 60);
  const xs = shown.flatMap((one) => one.x), ys = shown.flatMap((one) => [...one.y, ...(one.high || []), ...(one.low || [])]).filter((value) => value !== null);
  const x = options.x || [Math.min(...xs), Math.max(...xs)], y = options.y || [Math.min(0, ...ys), Math.max(...ys, 1) * 1.1];
  const f = frame(width, height, x, y, { ...options, margin: { right, ...options.margin } });
  const labels = [];
  shown.forEach((one) => {
    const points = one.x.map((value, j) => [f.sx(value), one.y[j] === null ? null : f.sy(one.y[j])]).filter(([, py]) => py !== null);
    const group = svg("g", { class: "m", style: look(one.name), "data-method": one.name });
    if (one.low?.some((value) => value !== null) && one.x.length > 1) {
      const upper = one.x.map((value, j) => `${f.sx(value)} ${f.sy(one.high[j] ?? one.y[j])}`), lower = one.x.map((value, j) => `${f.sx(value)} ${f.sy(one.low[j] ?? one.y[j])}`);
      group.append(svg("path", { class: "band", d: `M${upper.join("L")}L${lower.reverse().join("L")}Z` }));
    }
    const corner = (j) => (options.steps && j ? `${points[j][0].toFixed(1)} ${points[j - 1][1].toFixed(1)}L` : "");
    const d = points.map((p, j) => corner(j) + p.map((v) => v.toFixed(1)).join(" ")).join("L");
    group.append(svg("path", { class: "line", d: `M${d}`, "stroke-dasharray": dash(one.name) }));
    if (options.marks !== false) for (const [px, py] of points) group.append(marker(one.name, px, py));
    f.root.append(group);
    const last = points.at(-1);
    if (last && options.labels !== false) labels.push({ name: one.name, at: last, y: last[1], height: 14 });
  });
  for (const label of spread(labels, 8, f.height - 8)) {
    f.root.append(svg("line", { class: "lead-line", "data-method": label.name, x1: label.at[0] + 5, y1: label.at[1], x2: width - right + 10, y2: label.y }));
    f.root.append(svg("text", { x: width - right + 12, y: label.y + 4, "data-method": label.name }, label.name));
  }
  element.replaceChildren(f.root);
  return f;
}
