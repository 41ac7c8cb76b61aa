"""The page on ramps of one's own: its commands run in an empty folder, and print what stands there."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import sumolib
from command import merge_cosim

PAGE = Path(__file__).parents[3] / "docs" / "new-ramp.md"
TEXT = PAGE.read_text(encoding="utf-8")


def run(line: str, folder: Path) -> str:
    """Run one line of the page and return what it prints."""
    words = shlex.split(line, comments=True)
    if words[0] != "merge-cosim":
        subprocess.run(words, cwd=folder, check=True)
        return ""
    done = merge_cosim(*words[1:], cwd=folder, DISPLAY="", WAYLAND_DISPLAY="")
    if words[1:3] == ["ramp", "edit"]:
        assert (done.returncode, "no display" in done.stderr) == (2, True), done.stderr
        return done.stdout
    expected = int(line.rpartition("# status ")[2]) if "# status" in line else 0
    assert done.returncode == expected, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_every_command_of_the_page(tmp_path: Path) -> None:
    shutil.copy(PAGE.parent / "files" / "rosenbach.osm", tmp_path)
    for block in re.findall(r"```xml\n(.*?)```", TEXT, re.DOTALL):
        (tmp_path / re.match(r"<!-- (\S+) -->", block)[1]).write_text(block, encoding="utf-8")
    printed = {}
    for block in re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL):
        for line in block.splitlines():
            printed.setdefault(line, []).append(run(line, tmp_path))
    (shown,) = re.findall(r"```text\n(.*?)```", TEXT, re.DOTALL)
    (made,) = printed["merge-cosim ramp new rosenbach --from-osm rosenbach.osm"]
    assert shown in made
    assert "rosenbach.netccfg" in printed["merge-cosim ramp edit ramps/rosenbach"][0]
    (stale,) = printed["merge-cosim ramp check ramps/rosenbach    # status 1"]
    assert "not what its plain XML builds now" in stale
    assert printed["merge-cosim ramp check ramps/rosenbach"] == ["ramps/rosenbach: no problem found\n"] * 2
    rows = pq.read_table(tmp_path / "out/rosenbach/results.parquet").to_pandas()
    assert sorted(zip(rows["case"], rows["method"], strict=True)) == [
        (f"h{k}_m{k}", method) for k in (1, 2, 3) for method in ("acc", "pgm")
    ]
    assert (tmp_path / "out/rosenbach/report.html").is_file()
    # SUMO's own drivers arrive, too.
    sumo = [sumolib.checkBinary("sumo"), "-c", "rosenbach.sumocfg", "--tripinfo-output", "trips.xml"]
    subprocess.run(sumo, cwd=tmp_path, check=True, capture_output=True)
    assert {trip.id for trip in sumolib.xml.parse(str(tmp_path / "trips.xml"), "tripinfo")} == {
        f"{role}{k}" for role in "hm" for k in (1, 2, 3)
    }
