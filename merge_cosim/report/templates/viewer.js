// The case viewer: both cars on the road, and their records over time with one cursor.
const viewer = document.getElementById("viewer");
const RUN = { case: null, shown: [], time: 0, end: 1, playing: false, decoded: new Map() };
const part = (name) => document.getElementById(`viewer-${name}`);
const LANE = 13, CAR = 5;

function decode(run) {
  if (RUN.decoded.has(run)) return RUN.decoded.get(run);
  const digits = { host_station: 2, host_speed: 2, host_acceleration: 2, merging_station: 2, merging_speed: 2, belief: 3, follows: 0 };
  const found = { time: run.series.host_station.map((_, i) => run.start + i * run.step) };
  for (const [name, steps] of Object.entries(run.series)) {
    let sum = 0;
    found[name] = steps.map((step) => (sum += step) / 10 ** digits[name]);
  }
  const summed = (steps, digits) => { let sum = 0; return steps.map((step) => (sum += step) / 10 ** digits); };
  if (run.policies) Object.assign(found, { policy: summed(run.policy, 0), costs: run.costs.map((steps) => summed(steps, 1)) });
  RUN.decoded.set(run, found);
  return found;
}

function openViewer(number, method) {
  if (!viewer) return;
  const one = DATA.cases[number];
  Object.assign(RUN, { case: one, time: 0, playing: false });
  const names = one.runs.map((run) => run.method), rivals = names.filter((name) => !METHODS[name].reference);
  const passed = (run) => run.outcome.startsWith("passed"), of = (wanted) => one.runs.find((run) => rivals.includes(run.method) && passed(run) === wanted);
  const failing = one.runs.find((run) => run.failed && rivals.includes(run.method)) ?? of(false), passing = of(true);
  const first = [method, failing?.method, passing?.method, ...rivals].filter((name) => names.includes(name));
  RUN.shown = [...new Set(first)].slice(0, 2);
  if (!RUN.shown.length) RUN.shown = names.slice(0, 1);
  part("title").textContent = `${one.scenario}, case ${one.case}` + (one.host_speed === null ? "" : `: host ${one.host_speed} m/s, merging car ${one.merging_speed} m/s`);
  part("methods").replaceChildren(...one.runs.map((run) => {
    const label = html("label", { class: "m", style: look(run.method) }), box = html("input", { type: "checkbox", value: run.method });
    box.checked = RUN.shown.includes(run.method);
    box.addEventListener("change", () => {
      RUN.shown = all("input:checked", part("methods")).map((input) => input.value);
      layOut();
    });
    label.append(box, swatch(run.method), ` ${run.method} `, html("span", { class: "soft" }, run.outcome));
    return label;
  }));
  if (!viewer.open) viewer.showModal();
  layOut();
  part("play").focus();
}

const shownRuns = () => RUN.case.runs.filter((run) => RUN.shown.includes(run.method));
const indexAt = (records, run) => clamp(Math.round((RUN.time - run.start) / run.step), 0, records.time.length - 1);

function layOut() {
  const runs = shownRuns();
  const arrived = runs.map(decode).filter((records) => records.host_station.at(-1) >= 0).map((records) => records.time.at(-1));
  RUN.end = Math.max(0.1, ...(arrived.length ? arrived.map((time) => time + 1) : runs.map((run) => decode(run).time.at(-1))));
  RUN.end = Math.min(RUN.end, Math.max(0.1, ...runs.map((run) => decode(run).time.at(-1))));
  part("time").max = RUN.end.toFixed(1);
  drawPlots(runs);
  drawRoad(runs);
  setTime(Math.min(RUN.time, RUN.end));
}

// Roads: one per method, or all methods on one. x is the station; the ramp joins the road before station 0.
function drawRoad(runs) {
  const width = Math.max(part("ramp").clientWidth, 280), together = part("ghosts").checked || runs.length > 6;
  const rows = together ? [runs] : runs.map((run) => [run]);
  const stations = runs.flatMap((run) => {
    const records = decode(run);
    return records.time.flatMap((time, i) => (time > RUN.end ? [] : [records.host_station[i], records.merging_station[i]]));
  });
  const low = Math.min(-20, ...stations) - 8, high = clamp(Math.max(...stations), 20, 120) + 4;
  const rowHeight = 62, height = rows.length * rowHeight + 18;
  const sx = scale(low, high, 4, width - 4);
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": "The two cars on the road" });
  const defs = svg("defs"), hatch = svg("pattern", { id: "hatch", width: 5, height: 5, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" });
  hatch.append(svg("rect", { width: 5, height: 5, fill: "var(--page)" }), svg("line", { x1: 0, x2: 0, y1: 0, y2: 5, stroke: "var(--ink)", "stroke-width": 3 }));
  defs.append(hatch);
  root.append(defs);
  RUN.cars = [];
  rows.forEach((row, i) => {
    const y = i * rowHeight + 30, ramp = (s) => y + rampOffset(s);
    const steps = ticks(low, high, width / 70).filter((s) => s >= low);
    const points = Array.from({ length: 41 }, (_, k) => low + (k / 40) * (Math.min(0, high) - low));
    root.append(svg("path", { class: "road", d: `M${points.map((s) => `${sx(s)} ${ramp(s) - LANE / 2 - 1}`).join("L")}L${[...points].reverse().map((s) => `${sx(s)} ${ramp(s) + LANE / 2 + 1}`).join("L")}Z` }));
    for (const side of [-1, 1]) {
      const until = side < 0 ? points.filter((s) => rampOffset(s) > LANE + 1) : points;
      root.append(svg("path", { class: "edge", d: `M${until.map((s) => `${sx(s)} ${ramp(s) + side * (LANE / 2 + 1)}`).join("L")}` }));
    }
    root.append(svg("rect", { class: "road", x: sx(low), width: sx(high) - sx(low), y: y - LANE / 2 - 1, height: LANE + 2 }));
    root.append(svg("line", { class: "edge", x1: sx(low), x2: sx(high), y1: y - LANE / 2 - 1, y2: y - LANE / 2 - 1 }), svg("line", { class: "edge", x1: sx(0), x2: sx(high), y1: y + LANE / 2 + 1, y2: y + LANE / 2 + 1 }), svg("line", { class: "edge", x1: sx(low), x2: sx(-24), y1: y + LANE / 2 + 1, y2: y + LANE / 2 + 1 }));
    root.append(svg("line", { class: "cursor", x1: sx(0), x2: sx(0), y1: y - 16, y2: y + 26 }));
    for (const run of row) if (!together) root.append(svg("text", { class: "strong", x: 4, y: y - 14 }, `${run.method}: ${run.outcome}`));
    if (i === rows.length - 1) for (const s of steps) {
      const text = s === 0 ? "merging point" : `${written(s)} m`, half = textWidth(text) / 2;
      root.append(svg("text", { class: "tick", x: clamp(sx(s), half, width - half), y: height - 4, "text-anchor": "middle" }, text));
    }
    for (const run of row) {
      const group = svg("g", { class: "m", style: look(run.method), opacity: together && row.length > 1 ? 0.8 : 1 }), length = Math.max(4, sx(CAR) - sx(0));
      const host = svg("rect", { class: "car-host", width: length, height: LANE - 3, rx: 2.5 }), merging = svg("rect", { class: "car-merging", width: length, height: LANE - 3, rx: 2.5 });
      const cross = svg("path", { class: "cross", d: "M-9-9L9 9M-9 9L9-9", visibility: "hidden" });
      const name = svg("text", { "text-anchor": "end", class: "tick" }, together ? run.method : "");
      group.append(host, merging, cross, name);
      root.append(group);
      RUN.cars.push({ run, host, merging, cross, name, sx, y, length, lift: together ? -16 - 10 * (row.indexOf(run) % 2) : 0 });
    }
  });
  part("ramp").replaceChildren(root);
}

const rampOffset = (s) => (s >= 0 ? 0 : s < -40 ? 22 : 11 * (1 - Math.cos((Math.PI * s) / 40)));

function drawPlots(runs) {
  const host = part("plots");
  host.replaceChildren();
  RUN.plots = [];
  if (!runs.length) return;
  const planners = runs.filter((run) => run.policies);
  const areas = Array.from({ length: 5 + planners.length }, () => {
    const card = html("figure", { class: "card" }), area = html("div", { class: "chart" });
    card.append(area);
    host.append(card); // all of them first: their number decides how wide each is
    return area;
  });
  const add = (title, pick, options = {}) => {
    const area = areas.shift();
    area.before(html("figcaption", {}, title));
    const width = Math.max(area.clientWidth, 260);
    const series = options.series || runs.flatMap((run) => {
      const records = decode(run), until = records.time.filter((time) => time <= RUN.end + 1e-9).length;
      return [{ name: run.method, x: records.time.slice(0, until), y: pick(records).slice(0, until) }];
    });
    const values = series.flatMap((one) => one.y), room = (Math.max(...values) - Math.min(...values)) * 0.08 || 1;
    const y = options.y || [Math.min(...values) - room, Math.max(...values) + room];
    const f = lines(area, series, width, { x: [0, RUN.end], y, height: options.height || 170, marks: false, xLabel: "", margin: { bottom: 20 }, label: title, ...options.frame });
    if (options.also) for (const run of runs) {
      const records = decode(run), values = options.also(records);
      const d = values.map((value, i) => [records.time[i], value]).filter(([time, value]) => time <= RUN.end && value >= y[0] && value <= y[1]).map(([time, value]) => `${f.sx(time).toFixed(1)} ${f.sy(value).toFixed(1)}`).join("L");
      if (d) f.root.append(svg("path", { class: "line m", style: `${look(run.method)};stroke-width:1`, d: `M${d}`, "stroke-dasharray": "1 3" }));
    }
    const cursor = svg("line", { class: "cursor", y1: f.margin.top, y2: f.height - f.margin.bottom });
    f.root.append(cursor);
    RUN.plots.push({ cursor, sx: f.sx });
    area.addEventListener("pointerdown", (event) => { pause(); setTime(f.sx.invert(event.clientX - area.getBoundingClientRect().left)); });
    area.addEventListener("pointermove", (event) => { if (event.buttons) setTime(f.sx.invert(event.clientX - area.getBoundingClientRect().left)); });
    return { ...f, area };
  };
  const stations = runs.flatMap((run) => decode(run).host_station);
  add("Station [m]; dotted: merging car", (r) => r.host_station, { also: (r) => r.merging_station, y: [Math.min(...stations, ...runs.flatMap((run) => decode(run).merging_station)) - 5, clamp(Math.max(...stations), 20, 120)] });
  add("Speed [m/s]; dotted: merging car", (r) => r.host_speed, { also: (r) => r.merging_speed, y: [0, Math.max(...runs.flatMap((run) => [...decode(run).host_speed, ...decode(run).merging_speed])) * 1.08 + 1] });
  add("Acceleration of the host [m/s²]", (r) => r.host_acceleration);
  add("Belief: P(merging car does not yield)", (r) => r.belief, { y: [-0.05, 1.05], frame: { steps: true } });
  add("Decision of the host", (r) => r.follows, { y: [-0.2, 1.2], height: 110, frame: { steps: true, yTicks: [0, 1], yNames: ["go", "follow"] } });
  for (const run of planners) policyPlot(run, add);
}

// Expected cost of each policy above the cheapest one's; the driven one is drawn thick.
const POLICY_COLORS = {{ colors.DISTINCT | tojson }};
const MOST_COST = 8;
const again = (k) => Math.floor(k / POLICY_COLORS.length) % 2; // the colours come again, dashed
function policyPlot(run, add) {
  const { time, policy, costs } = decode(run), least = policy.map((_, i) => Math.min(...costs.map((one) => one[i])));
  const above = (i, value) => Math.min(value - least[i], MOST_COST);
  const drawn = add(`Expected cost of each policy of ${run.method} above the cheapest${run.unit && ` [${run.unit}]`}; thick: driven`, null, { series: [{ name: run.method, x: time.slice(0, policy.length), y: policy.map((_, i) => above(i, costs[policy[i]][i])) }], y: [-0.3, MOST_COST + 0.3], height: 220 });
  const driven = drawn.root.querySelector("g .line");
  driven.setAttribute("style", "stroke-width:6;opacity:.45");
  driven.removeAttribute("stroke-dasharray");
  const used = run.policies.map((name, k) => ({ name, k })).sort((a, b) => policy.filter((p) => p === b.k).length - policy.filter((p) => p === a.k).length);
  const key = html("p", { class: "legend" });
  for (const { name, k } of used) {
    const style = `stroke:${POLICY_COLORS[k % POLICY_COLORS.length]};stroke-width:1.2`;
    const points = costs[k].map((value, i) => `${drawn.sx(time[i]).toFixed(1)} ${drawn.sy(above(i, value)).toFixed(1)}`).filter((_, i) => time[i] <= RUN.end);
    if (points.length) drawn.root.append(svg("path", { class: "line", style, d: `M${points.join("L")}`, "stroke-dasharray": again(k) ? "5 3" : "none" }));
    key.append(html("span", { style: `color:${POLICY_COLORS[k % POLICY_COLORS.length]};font-weight:700` }, again(k) ? "╌ " : "— "), `${written(name)}  `);
  }
  drawn.area.after(key);
}

function setTime(time) {
  RUN.time = clamp(time, 0, RUN.end);
  part("time").value = RUN.time.toFixed(1);
  part("clock").textContent = `${RUN.time.toFixed(1)} s`;
  for (const { cursor, sx } of RUN.plots) { cursor.setAttribute("x1", sx(RUN.time)); cursor.setAttribute("x2", sx(RUN.time)); }
  for (const { run, host, merging, cross, name, sx, y, length, lift } of RUN.cars) {
    const records = decode(run), i = indexAt(records, run), h = records.host_station[i], m = records.merging_station[i];
    host.setAttribute("transform", `translate(${sx(h) - length} ${y - (LANE - 3) / 2})`);
    merging.setAttribute("transform", `translate(${sx(m) - length} ${y + rampOffset(m) - (LANE - 3) / 2})`);
    name.setAttribute("transform", `translate(${sx(h)} ${y + lift})`);
    cross.setAttribute("visibility", run.failed && i === records.time.length - 1 ? "visible" : "hidden");
    cross.setAttribute("transform", `translate(${sx(Math.max(h, m)) - length} ${y})`);
  }
}

function pause() { RUN.playing = false; part("play").textContent = "▶ Play"; }

function play() {
  if (RUN.playing) return pause();
  if (RUN.time >= RUN.end - 1e-6) setTime(0);
  RUN.playing = true;
  part("play").textContent = "❚❚ Pause";
  let last = performance.now();
  const step = (now) => {
    if (!RUN.playing || !viewer.open) return;
    setTime(RUN.time + ((now - last) / 1000) * Number(part("rate").value));
    last = now;
    if (RUN.time >= RUN.end) return pause();
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

if (viewer) {
  part("close").addEventListener("click", () => viewer.close());
  viewer.addEventListener("close", pause);
  viewer.addEventListener("click", (event) => { if (event.target === viewer) viewer.close(); });
  part("play").addEventListener("click", play);
  part("time").addEventListener("input", () => { pause(); setTime(Number(part("time").value)); });
  part("ghosts").addEventListener("change", layOut);
  viewer.addEventListener("keydown", (event) => {
    const inField = ["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName);
    const jumps = { ArrowRight: RUN.time + 0.1, ArrowLeft: RUN.time - 0.1, Home: 0, End: RUN.end };
    if (event.key === " " && !inField) { event.preventDefault(); play(); }
    if (event.key in jumps && event.target.tagName !== "SELECT") { event.preventDefault(); pause(); setTime(jumps[event.key]); }
  });
  window.addEventListener("resize", () => viewer.open && layOut());
}
