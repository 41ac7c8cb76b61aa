"""The page in a browser driven by playwright: axe finds nothing at level AA, nothing sticks out, no script fails."""

import pytest

axe = pytest.importorskip("axe_playwright_python.sync_playwright")
RULES = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"]}
UNFOLD = "document.querySelectorAll('details').forEach((one) => { one.open = true; })"


@pytest.mark.parametrize(
    ("width", "theme", "viewer"),
    [(1400, "light", ""), (400, "dark", ""), (1400, "dark", "&case=0"), (400, "light", "&case=0")],
)
def test_axe_finds_nothing(swept, browser, width, theme, viewer):
    page = browser.new_page(viewport={"width": width, "height": 900})
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(f"{(swept / 'report.html').as_uri()}?theme={theme}{viewer}")
    page.evaluate(UNFOLD)
    found = axe.Axe().run(page, options=RULES).response["violations"]
    assert [(one["id"], node["target"], node["html"]) for one in found for node in one["nodes"]] == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
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
