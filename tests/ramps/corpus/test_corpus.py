"""Every ramp of the corpus: the main road and the host's lane are the right ones; some are made and driven."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from command import merge_cosim
from corpus_case import Case
from corpus_maps import OSM
from corpus_nets import NETS

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.check import check
from merge_cosim.ramps.create.from_net import ramp_from_net
from merge_cosim.ramps.create.from_osm import ramp_from_osm, read_extract
from merge_cosim.ramps.create.onramp import choose, read_source

DRIVEN = (
    *("exit 700 m after", "no limit, guessed lane", "left-hand traffic, exit after", "fan-out of both"),
    *("from the left", "hard shoulder"),
)
"""Those that are also made, checked and driven, one of each kind."""


def ways(edges: Sequence[str]) -> list[str]:
    """Numbers of the ways that netconvert made edges of, each once."""
    return list(dict.fromkeys(re.sub(r"^-|[#-].*$", "", edge) for edge in edges))


TAKEN, REFUSED = ([case for case in [*OSM, *NETS] if bool(case.refused) is refused] for refused in (False, True))


@pytest.mark.parametrize("case", TAKEN, ids=[case.name for case in TAKEN])
def test_the_paths_are_the_right_ones(tmp_path: Path, case: Case) -> None:
    numbers = case.numbers or {}
    file = case.make(tmp_path)
    link, plain = numbers.get("link"), list
    if case in OSM:
        file, _ = read_extract(file, tmp_path, link, None, numbers.get("left_hand"))
        plain = ways
    _, path = choose(read_source(file, file), link, 700.0, 1500.0)
    edges = [lane.getEdge().getID() for lane in path.main]
    assert plain(edges) == list(case.main), path.reasons
    assert plain([lane.getEdge().getID() for lane in path.ramp]) == list(case.ramp)
    host = path.main[path.before]
    assert host.getEdge().getLaneNumber() - 1 - host.getIndex() == case.from_left, path.reasons
    assert bool(path.beside) == case.lane
    assert all(lane.allows("passenger") for lane in (*path.main, *path.ramp))


@pytest.mark.parametrize("case", REFUSED, ids=[case.name for case in REFUSED])
def test_it_is_refused_with_the_reason(tmp_path: Path, case: Case) -> None:
    make = ramp_from_net if case in NETS else ramp_from_osm
    with pytest.raises(UserError, match=case.refused):
        make(tmp_path / "mine", case.make(tmp_path), **(case.numbers or {}))


@pytest.mark.parametrize("name", DRIVEN)
def test_it_is_made_passes_its_check_and_is_driven(tmp_path: Path, name: str) -> None:
    (case,) = (case for case in [*OSM, *NETS] if case.name == name)
    make = ramp_from_net if case in NETS else ramp_from_osm
    folder = make(tmp_path / "mine", case.make(tmp_path), **(case.numbers or {}))
    assert check(folder) == []
    assert (folder / "ramp.png").is_file()
    text = (folder / "ramp.toml").read_text(encoding="utf-8")
    assert "# main: the same road" in text
    assert "# host_lane: lane" in text
    words = ("run", "designed-2", "--case", "d+1_h15_m14", "--set", f"ramp={folder}", "--method", "acc")
    done = merge_cosim(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "broken invariant" not in done.stdout
