// The page itself: charts in their places, sorting, filter, theme, links to the viewer.
for (const name of all(".short .name")) name.prepend(swatch(name.dataset.watch), " ");
for (const section of all("[data-test]")) {
  const data = DATA.tests[section.dataset.test], place = (name) => section.querySelector(`[data-chart="${name}"]`);
  drawn(place("tradeoff"), (width) => tradeoff(place("tradeoff"), data.rows, width));
  if (data.map) failureMaps(place("maps"), data.map, data.cases, section.querySelector('[data-readout="maps"]'));
  if (data.delays) delayDots(place("delays"), data.delays);
  if (data.beliefs) {
    const { right, calibration } = data.beliefs;
    const gates = [...new Set(right.flatMap((one) => one.x))].sort((a, b) => a - b);
    drawn(place("right"), (width) => lines(place("right"), right.map((one) => ({ ...one, x: one.x.map((gate) => -gate) })), width, { y: [Math.max(0, Math.min(...right.flatMap((one) => one.y)) - 5), 102], xTicks: gates.map((gate) => -gate), xNames: gates, label: "Right decisions by distance" }));
    drawn(place("calibration"), (width) => {
      const f = lines(place("calibration"), calibration, width, { x: [0, 100], y: [0, 104], label: "Calibration" });
      f.root.append(svg("line", { class: "cursor", x1: f.sx(0), y1: f.sy(0), x2: f.sx(100), y2: f.sy(100) }));
    });
  }
  for (const button of all("[data-watch]", section)) button.disabled = !data.cases.length;
  section.addEventListener("click", (event) => {
    const watched = event.target.closest("[data-watch]"), chosen = event.target.closest("[data-case]");
    if (chosen) openViewer(Number(chosen.dataset.case));
    else if (watched && data.cases.length) {
      const has = (number) => DATA.cases[number].runs.some((run) => run.method === watched.dataset.watch);
      openViewer(data.cases.find(has) ?? data.cases[0], watched.dataset.watch);
    }
  });
}

for (const place of all('[data-chart="variation"]')) {
  for (const plot of DATA.variations[Number(place.dataset.number)]) {
    const card = html("figure", { class: "card" }), area = html("div", { class: "chart" });
    card.append(html("figcaption", {}, `Failures [%] by ${plot.parameter}` + (plot.site === plot.source ? "" : `, ${plot.site} (${plot.source})`)), area);
    place.append(card);
    const named = plot.values.length ? { x: [-0.3, plot.values.length - 0.7], xTicks: plot.values.map((_, i) => i), xNames: plot.values } : {};
    drawn(area, (width) => lines(area, plot.series, width, { xLabel: plot.parameter, ...named, label: `Failures by ${plot.parameter}` }));
  }
}

for (const choice of all("[data-cases]")) choice.addEventListener("change", () => choice.value !== "" && openViewer(Number(choice.value)));

for (const table of all("table.sortable")) {
  all("thead button", table).forEach((button, column) => button.addEventListener("click", () => {
    const head = button.closest("th"), down = head.getAttribute("aria-sort") === "ascending";
    all("th", table.tHead).forEach((one) => one.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const key = (row) => { const cell = row.cells[column]; return cell.dataset.value === undefined ? cell.textContent.trim() : cell.dataset.value === "" ? Infinity : Number(cell.dataset.value); };
    const compare = (a, b) => (typeof a === "string" ? a.localeCompare(b) : a - b);
    const rows = [...table.tBodies[0].rows].sort((a, b) => (down ? -1 : 1) * compare(key(a), key(b)));
    table.tBodies[0].append(...rows);
  }));
}

function applyFilter() {
  const words = document.getElementById("filter").value.toLowerCase().split(/[\s,]+/).filter(Boolean);
  const hit = (method) => !words.length || words.some((word) => method.toLowerCase().includes(word));
  for (const element of all("[data-method]")) element.classList.toggle("faded", !hit(element.dataset.method));
  for (const row of all("tbody tr:not([data-method])")) {
    const name = row.querySelector("th")?.textContent.trim();
    if (name in METHODS) row.classList.toggle("faded", !hit(name));
  }
}
document.getElementById("filter").addEventListener("input", applyFilter);

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  for (const redraw of themed) redraw();
}
document.getElementById("theme").addEventListener("click", () => setTheme(isDark() ? "light" : "dark"));
darkSystem.addEventListener("change", () => { for (const redraw of themed) redraw(); });
const asked = new URLSearchParams(location.search).get("theme");
if (asked === "dark" || asked === "light") setTheme(asked);

for (const box of all(".wide")) {
  new ResizeObserver(() => {
    const hidden = box.scrollWidth > box.clientWidth + 4, before = box.previousElementSibling?.classList.contains("more-columns") ? box.previousElementSibling : null;
    if (hidden && !before) box.before(html("p", { class: "more-columns" }, "More columns to the right: scroll the table →"));
    if (!hidden && before) before.remove();
  }).observe(box);
}

function unfold() {
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (target?.tagName === "DETAILS") { target.open = true; target.scrollIntoView(); }
}
window.addEventListener("hashchange", unfold);
for (const link of all('.bar a[href^="#"]')) link.addEventListener("click", () => setTimeout(unfold));
unfold();
window.addEventListener("beforeprint", () => { for (const fold of all("details")) fold.open = true; });
const seen = new URLSearchParams(location.search).get("case");
if (seen !== null && DATA.cases[Number(seen)]) openViewer(Number(seen));
