"""Reports of very different sweeps in a browser, at two widths and in both themes: nothing is cut off or sticks out."""

from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import pytest
from scene_files import SMALL

SCENARIO = """
title = "Nine cases"
about = "Both cars at three speeds each, side by side."
ramp = "designed"

[encounters]
kind = "grid"
host_offset = { from = OFFSET, to = OFFSET, step = 1 }
host_speed = { SPEEDS }
merging_speed = { SPEEDS }

[merging]
model = "designed"
ahead = "clear"
"""
LONG = "an-estimator-whose-name-is-longer-than-any-column"
PLUGIN = """
import numpy as np
import merge_cosim as mc

@mc.estimator
class AnEstimatorWhoseNameIsLongerThanAnyColumn(mc.Estimator):
    def update(self, seen):
        return np.where(seen.host_station > seen.merging_station, -1.0, 1.0)


@mc.estimator
class Blind(mc.Estimator):
    def update(self, seen):
        return -np.ones_like(seen.host_station)
"""
MANY = (
    "acc,slot,slot-time,ipcb,pgm-g,pgm,pgm-symmetric,pgm-time,pgm-speed,fg,fg-time,fg-gmm,acc+lqr,slot+lqr,pgm+lqr,"
    f"{LONG},{LONG}+lqr-direct,always-go,always-yield,oracle-best"
)
TRAFFIC = SMALL.replace("replications = 3", "replications = 1").replace("duration = 60", "duration = 30")
SURROGATE = ("--source", "surrogate", "--method", "acc,pgm", "--model", "us101-ngsim")
FEW = ("--set", "encounters.fraction=0.97")
SWEEPS = {
    "one, no failure": ("apart.toml", "--method", "acc", "--world", "closed-form"),
    "all fail": ("alike.toml", "--method", "blind", "--plugin", "mine.py", "--world", "closed-form"),
    "three, varied": ("beside.toml", "--method", "acc,slot,pgm", "--vary", "acc.headway=1,2", "--world", "closed-form"),
    "many, long names": ("beside.toml", "--method", MANY, "--plugin", "mine.py", "--world", "closed-form"),
    "replay": ("us101-replay", *SURROGATE, *FEW, "--world", "closed-form"),
    "traffic": ("traffic.toml", "--method", "acc"),
}
"""The words of each sweep."""
UNFOLD = "document.querySelectorAll('details').forEach((one) => { one.open = true; })"
CUT = """() => {
  const seen = (one) => one.getClientRects().length && getComputedStyle(one).visibility !== "hidden";
  const cut = [];
  for (const text of document.querySelectorAll("svg text")) {
    if (!text.textContent || !seen(text)) continue;
    const inner = text.getBoundingClientRect(), outer = text.closest("svg").getBoundingClientRect();
    const across = Math.max(outer.left - inner.left, inner.right - outer.right);
    const out = Math.max(across, outer.top - inner.top, inner.bottom - outer.bottom);
    if (out > 3) cut.push(`${text.textContent} is ${out.toFixed(0)} px outside its drawing`);
  }
  const parts = "h1, h2, h3, p, li, dd, button, label, figcaption, summary, a, canvas, svg";
  for (const one of document.querySelectorAll(parts)) {
    if (!seen(one) || one.closest(".unseen, .wide, .bar nav, figure.whole, defs")) continue;
    const { left, right } = one.getBoundingClientRect();
    const name = `${one.tagName} ${one.textContent.slice(0, 40)}`, hides = getComputedStyle(one).overflowX === "hidden";
    if (left < -1 || right > innerWidth + 1) cut.push(`${name} sticks out`);
    if (hides && one.scrollWidth > one.clientWidth + 1) cut.push(`${name} is cut`);
  }
  for (const box of document.querySelectorAll(".wide")) {
    const name = box.getAttribute("aria-label"), caption = box.querySelector("caption");
    if (box.querySelector("tbody th")?.offsetWidth > 0.5 * box.clientWidth) cut.push(`${name}: names hide the numbers`);
    if (caption?.scrollWidth > box.clientWidth) cut.push(`${name}: the caption is cut`);
  }
  return cut;
}"""
"""Texts outside their drawing, parts of the page outside the window or cut off, tables of which one sees names only."""
LOOK = """([width, theme]) => {
  const shades = getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number);
  const fits = document.documentElement.scrollWidth <= width;
  return [innerWidth === width, fits, Math.max(...shades) > 128 === (theme === "light")];
}"""
"""Whether the page has this width and theme."""
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the scenarios and the plugin are."""
    made = tmp_path_factory.mktemp("pictures")
    coarse, fine = "from = 5, to = 25, step = 10", "from = 15, to = 16, step = 0.5"
    for name, offset, speeds in (("apart", "-30", coarse), ("beside", "0", coarse), ("alike", "0", fine)):
        (made / f"{name}.toml").write_text(SCENARIO.replace("OFFSET", offset).replace("SPEEDS", speeds))
    (made / "mine.py").write_text(PLUGIN)
    (made / "traffic.toml").write_text(TRAFFIC)
    return made


@pytest.fixture(scope="module", params=SWEEPS)
def report(request, folder: Path, command: Callable[..., int], browser) -> Iterator[Path]:
    """The report of one sweep."""
    out = folder / request.param.partition(",")[0].replace(" ", "-")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert command("sweep", *SWEEPS[request.param], "--jobs", 1, "--traces", 2, "--out", out) == 0
        assert command("report", out) == 0
    return out / "report.html"


def test_nothing_is_cut_off(report, browser):
    page = browser.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(report.as_uri())
    page.evaluate(UNFOLD)
    page.wait_for_function("document.querySelector('.tradeoff .dot')")
    for viewer, width, theme in product((False, True), (1400, 400), ("light", "dark")):
        if viewer and not page.locator("dialog[open]").count():
            page.locator("button[data-case]").first.click()
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=theme)
        page.evaluate(DRAWN)
        assert page.evaluate(CUT) == []
        assert page.evaluate(LOOK, [width, theme]) == [True, True, True]
    assert errors == []
    page.close()
