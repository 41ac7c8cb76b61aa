"""Runs what a page of the documentation tells its reader to do: each block, in order, in one folder.

Blocks in `python` run as one program, or are written to the file that their first line names (`# my.py`), as are those
in `toml` and `xml` (`<!-- my.rou.xml -->`). The files that those in `tex` include must be there. Blocks without
a language are commands.

Commands are run for real, in this process, in a shorter form:

- a sweep gets the settings of `FEWER` for its scenarios, unless it sets the same keys itself, and one process;
- what opens a window, takes minutes or asks the network (`PARSED`) is only parsed: `--help` is added, before which
  typer refuses a command or an option that there is not; `--gui` is left out after that;
- of `make TARGET` the lines that `make` would run are taken: those of `merge-cosim` are run in turn;
- figures for a paper are written in one format;
- a route configuration for `sumo-gui` is run by `sumo`;
- `pip install` must ask for extras that there are.
"""

import re
import shlex
import shutil
import subprocess
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import sumolib
from command import merge_cosim

from merge_cosim.report import figures

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
GRID = ("encounters.host_offset.step=5", "encounters.host_speed.step=12", "encounters.merging_speed.step=12")
SCENE = ("encounters.replications=1", "encounters.demand.duration=30", "encounters.demand.warm_up=5")
FEWER = {
    "designed-1": ("encounters.fraction=0.97",),
    "designed-2": GRID,
    "designed-3": ("encounters.count=20",),
    "designed-random": ("encounters.count=40",),
    "us101-replay": ("encounters.fraction=0.97",),  # the share of the cars for training; the others are tested
    "traffic-dense": SCENE,
    "traffic-light": SCENE,
    "traffic-stop-and-go": SCENE,
}
PARSED = (("ngsim", "download"), ("ramp", "edit"), ("reproduce",))
TOUCHES_NOTHING = ("cd", "cp", "mkdir", "sed")


def follow(page: Path, folder: Path, replaced: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Do in `folder`, the working folder, what the page says with some text replaced; returns its program's names."""
    text = page.read_text(encoding="utf-8")
    for old, new in (replaced or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in BLOCK.finditer(text):
        language, inside = block["language"], block["text"]
        named = re.match(r"(?:#|<!--) ([\w.-]+\.(?:py|toml|xml|sumocfg))\b", inside)
        if named and language in ("python", "toml", "xml"):
            (folder / named[1]).write_text(inside, encoding="utf-8")
        elif language == "python":
            exec(compile(inside, str(page), "exec"), names)
        elif language == "tex":
            for file in re.findall(r"\\(?:input|includegraphics)(?:\[.*?\])?\{(.+?)\}", inside):
                assert (folder / file).is_file(), f"{page.name}: no {file}"
        elif language in ("", "sh"):
            for line in commands(inside):
                done = run(line, folder)
                assert done.returncode == 0, f"{page.name}: {line}: {done.stderr}"
    return names


def commands(block: str) -> Iterator[str]:
    """The commands of a block, without comments."""
    for line in block.replace("\\\n", " ").splitlines():
        if words := shlex.split(line, comments=True):
            yield shlex.join(words)


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in its shorter form."""
    program, *words = shlex.split(line)
    if program == "merge-cosim":
        return _merge_cosim(words, folder)
    if program == "make":
        dry_run = _process(["make", "--dry-run", *words, "VENV=venv", "BIN=."], ROOT)
        for each in dry_run.stdout.replace("\\\n", " ").splitlines():
            if each.startswith("./merge-cosim "):
                done = run(each.removeprefix("./"), folder)
                if done.returncode:
                    return done
        return dry_run
    if program == "sumo-gui":
        return _process([sumolib.checkBinary("sumo"), "-c", *words, "--end", "30"], folder)
    if (program, words[0]) == ("pip", "install"):
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        asked = re.findall(r"[\w-]+(?=[\],])", line.partition("[")[2])
        return subprocess.CompletedProcess(line, int(not set(asked) <= set(extras)), "", f"no such extra: {asked}")
    assert program in TOUCHES_NOTHING, f"no rule for {line}"
    return _process([program, *words], folder)


def _merge_cosim(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    if any(tuple(words[: len(each)]) == each for each in PARSED):
        return merge_cosim(*words, "--help", cwd=folder)
    if "--gui" in words:
        parsed = merge_cosim(*words, "--help", cwd=folder)
        if parsed.returncode:
            return parsed
        words = [word for word in words if word != "--gui"]
    if words[0] == "sweep":
        asked = {word.partition("=")[0] for word in words}
        fewer = dict.fromkeys(setting for word in words for setting in FEWER.get(word, ()))
        words += [w for setting in fewer if setting.partition("=")[0] not in asked for w in ("--set", setting)]
        words += ["--jobs", "1"] if "--dask" not in words else []
    with patch.object(figures, "FORMATS", ("pdf",)):
        return merge_cosim(*words, cwd=folder)


def _process(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    assert shutil.which(words[0]), words[0]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
