"""The page in a real browser, where Chromium is installed: its scripts run without an error and draw everything."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from lxml import html
from PIL import Image

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"),
    *("--hide-scrollbars", "--virtual-time-budget=3000", "--enable-logging=stderr", "--window-size=1400,1000"),
)


def _browse(address: str, profile: Path, *more: str) -> str:
    done = subprocess.run(
        [str(CHROMIUM), *FLAGS, f"--user-data-dir={profile}", *more, address],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "Uncaught" not in done.stderr
    return done.stdout


def test_charts_are_drawn_and_a_case_can_be_watched(swept, tmp_path):
    address = f"{(swept / 'report.html').as_uri()}?case=0&theme=dark"
    page = html.fromstring(_browse(address, tmp_path / "profile", "--dump-dom"))
    assert page.get("data-theme") == "dark"
    dots = page.xpath("//*[@data-chart='tradeoff']//*[contains(@class, 'dot')]/@data-method")
    assert sorted(dots) == ["acc", "always-go", "pgm-time", "slot"]
    maps = page.xpath("//*[@data-chart='maps']//canvas")
    assert len(maps) == 4
    assert all(int(canvas.get("width")) > 100 for canvas in maps)
    assert page.xpath("//dialog[@open]")
    assert len(page.xpath("//dialog//*[@id='viewer-plots']//*[local-name()='svg']")) == 5
    assert len(page.xpath("//dialog//*[contains(@class, 'car-host')]")) == 2


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_first_screen_is_not_blank(swept, tmp_path, theme):
    picture = tmp_path / "page.png"
    address = f"{(swept / 'report.html').as_uri()}?theme={theme}"
    _browse(address, tmp_path / "profile", f"--screenshot={picture}")
    pixels = np.asarray(Image.open(picture).convert("L"), dtype=float)
    assert (pixels.mean() < 90) == (theme == "dark")
    half = pixels.shape[1] // 2
    assert min(pixels[150:700, :half].std(), pixels[150:700, half:].std()) > 5  # the chart, the table
