"""The page in a browser driven by playwright: axe finds nothing at level AA, nothing sticks out, no script fails."""

from itertools import product

import pytest

axe = pytest.importorskip("axe_playwright_python.sync_playwright")
RULES = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"]}
CHANGING = {"runOnly": ["color-contrast", "scrollable-region-focusable", "target-size"]}
UNFOLD = "document.querySelectorAll('details').forEach((one) => { one.open = true; })"


def test_axe_finds_nothing(swept, browser):
    page = browser.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto((swept / "report.html").as_uri())
    page.evaluate(UNFOLD)
    rules = RULES  # all of them once for the page and the viewer, then those that width and theme change
    for viewer, width, theme in product((False, True), (1400, 400), ("light", "dark")):
        if viewer and not page.locator("dialog[open]").count():
            page.locator("button[data-case]").first.click()
            rules = RULES
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=theme)
        found = axe.Axe().run(page, options=rules).response["violations"]
        assert [(one["id"], node["target"], node["html"]) for one in found for node in one["nodes"]] == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        rules = CHANGING
    assert errors == []
    page.close()


def test_a_case_is_watched_by_keyboard(swept, browser):
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto((swept / "report.html").as_uri())
    page.locator("button[data-case]").first.focus()
    page.keyboard.press("Enter")
    clock = page.locator("#viewer-clock")
    assert page.locator("dialog[open]").count() == 1
    before = clock.inner_text()
    page.keyboard.press("End")
    assert clock.inner_text() != before
    page.keyboard.press("Escape")
    assert page.locator("dialog[open]").count() == 0
    page.close()


def test_rows_of_references_are_laid_out_as_rows(swept, browser):
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto((swept / "report.html").as_uri())
    page.evaluate(UNFOLD)
    rows = page.locator("main table tbody tr")
    displayed = rows.evaluate_all("(rows) => rows.map((row) => getComputedStyle(row).display)")
    assert set(displayed) == {"table-row"}
    page.close()


def test_the_filter_fades_dots_and_hides_rows_and_maps(swept, browser):
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto((swept / "report.html").as_uri())
    page.evaluate(UNFOLD)
    page.locator("#filter").fill("acc, slot")
    shown = """(chosen) => [...document.querySelectorAll(chosen)].map((one) => {
      const style = getComputedStyle(one);
      return [one.dataset.method, style.display !== "none" && Number(style.opacity)];
    })"""
    others = {"always-go", "pgm-time"}
    for chosen, faint in ((".tradeoff .dot", 0.13), (".short tbody tr", False), (".map", False)):
        found = dict(page.evaluate(shown, chosen))
        assert found == {method: faint if method in others else 1 for method in ("acc", "slot", *others)}
    page.close()
