"""Make the pictures of docs/gallery.md anew: python tools/gallery_page.py runs its commands in a folder of their own.

A picture's source is named in the line before it: `<!-- picture: FILE -->`, or for a screenshot `<!-- picture:
PAGE THEME WIDTH HEIGHT -->`, which needs playwright and a Chromium that is installed.
"""

import contextlib
import io
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from blocks import DOCS, page_parser
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from merge_cosim.cli.main import main as merge_cosim

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
COMMANDS = re.compile(r"^```\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(r"<!-- picture: (?P<source>[^>]+) -->\n!\[[^\]]*\]\((?P<target>[^)]+)\)")
COARSE = ("encounters.host_speed.step=8", "encounters.merging_speed.step=8", "encounters.host_offset.step=5")
SHORT = {"designed-2": COARSE, "designed-3": ("encounters.count=40",)}
"""Settings of the short mode."""
FEW = "acc,pgm"
"""Methods of the short mode."""


def run_commands(text: str, folder: Path, short: bool) -> None:
    """Run the page's commands, but for those that open a window."""
    for block in COMMANDS.findall(text):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if "--gui" in words:
                continue
            if short and words[1] == "sweep":
                words[words.index("--method") + 1] = FEW
                words += ["--jobs", "1"]
                words += [word for setting in SHORT[words[2]] for word in ("--set", setting)]
            run_here(words, folder)


def run_here(words: list[str], folder: Path) -> None:
    """Run a command in this process; what it prints is left out."""
    before, sys.argv = sys.argv, words
    try:
        with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
            merge_cosim()
    except SystemExit as ended:
        if ended.code:
            raise
    finally:
        sys.argv = before


def screenshot(browser: Browser, address: str, theme: str, width: int, height: int, target: Path) -> None:
    """A page as it is seen in a window of that size."""
    window = {"width": width, "height": height}
    page = browser.new_page(viewport=window, color_scheme="dark" if theme == "dark" else "light")
    page.goto(address)
    page.wait_for_timeout(500)
    page.screenshot(path=target)
    page.close()


def main(argv: Sequence[str] | None = None) -> None:
    """Run the commands and place the pictures."""
    given = page_parser(__doc__).parse_args(argv)
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as made, sync_playwright() as playwright:
        run_commands(text, folder := Path(made), given.short)
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for picture in PICTURE.finditer(text):
            source, *how = picture["source"].split()
            target = given.docs / picture["target"]
            target.parent.mkdir(parents=True, exist_ok=True)
            if how:
                theme, width, height = how
                address = f"{folder.as_uri()}/{source}"
                screenshot(browser, address, theme, int(width), int(height), target)
            else:
                shutil.copy(folder / source, target)
            Image.open(target).convert("RGB").save(target, optimize=not given.short)


if __name__ == "__main__":
    main()
