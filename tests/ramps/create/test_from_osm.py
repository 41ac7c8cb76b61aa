"""Ramps from extracts of OpenStreetMap, through netconvert."""

import gzip
import json
import math
import re
from pathlib import Path

import pytest
import sumolib
from command import refused
from typer.testing import CliRunner

from merge_cosim.cli.ramp import app
from merge_cosim.core.errors import UserError
from merge_cosim.ramps.build import netconvert
from merge_cosim.ramps.check import check, notes
from merge_cosim.ramps.create.from_osm import ramp_from_osm
from merge_cosim.ramps.definition import read_ramp_file
from merge_cosim.ramps.ramp import Ramp

EXTRACT = Path(__file__).parents[3] / "docs" / "files" / "rosenbach.osm"
TEXT = EXTRACT.read_text(encoding="utf-8")


def write(folder: Path, text: str) -> Path:
    file = folder / "extract.osm"
    file.write_text(text, encoding="utf-8")
    return file


def test_an_acceleration_lane_as_mappers_draw_it(tmp_path: Path) -> None:
    folder = ramp_from_osm(tmp_path / "mine", EXTRACT)
    assert (check(folder), notes(folder)) == ([], [])
    ramp = Ramp.load(folder)
    assert (ramp.main_route, ramp.ramp_route) == (("1001", "1002", "1003"), ("2001", "1002", "1003"))
    assert ramp.speed_limit == pytest.approx(120 / 3.6, abs=0.01)
    # The way of the acceleration lane is 240 m along an arc; netconvert's junction shifts its end by a lane.
    assert ramp.auxiliary_end == pytest.approx(240.0, abs=2.0)
    assert ramp.merging_point == 48.0
    # Georeferenced: SUMO itself puts the gore's node where the extract has it, within the lanes' width.
    netconvert(ramp.net, "-s", str(ramp.net), "--plain-output-prefix", str(tmp_path / "geo"), "--proj.plain-geo")
    nodes = {node.id: node for node in sumolib.xml.parse(str(tmp_path / "geo.nod.xml"), "node")}
    east = math.cos(math.radians(48.2)) * (float(nodes["104"].x) - 11.65)
    assert 111_320 * math.hypot(east, float(nodes["104"].y) - 48.2) < 8.0


def test_an_acceleration_lane_that_is_guessed_is_reported(tmp_path: Path) -> None:
    text = TEXT.replace('k="lanes" v="3"', 'k="lanes" v="2"').replace(
        '"ref" v="A 97"', '"name" v="King\'s &amp; Queen\'s"'
    )
    folder = ramp_from_osm(tmp_path / "mine", write(tmp_path, text))
    file = read_ramp_file(folder)
    assert file.title == "mine: on-ramp onto King's & Queen's"
    assert file.sources["acceleration_lane"] == "Guessed by netconvert, 210 m: extract.osm has none."
    # Long enough to brake comfortably from 120 km/h after the merging point, 33.33^2 / 2 / 3.4 = 163 m.
    assert Ramp.load(folder).auxiliary_end == pytest.approx(210.0, abs=1.0)
    assert (check(folder), notes(folder)) == ([], [])


def test_a_missing_limit_is_a_problem_and_can_be_given(tmp_path: Path) -> None:
    bare = write(tmp_path, "\n".join(line for line in TEXT.splitlines() if "maxspeed" not in line))
    line = r"extract\.osm: no speed limit for '1002': 39\.44 m/s is SUMO's default .*; give one with --speed-limit"
    with pytest.raises(UserError, match=line):
        ramp_from_osm(tmp_path / "bare", bare)
    assert not (tmp_path / "bare").exists()
    assert check(ramp_from_osm(tmp_path / "given", bare, speed_limit=30.0)) == []


def test_a_compressed_extract_through_the_command(tmp_path: Path) -> None:
    packed = tmp_path / "rosenbach.osm.gz"
    packed.write_bytes(gzip.compress(TEXT.encode()))
    words = ["new", "mine", "--out", str(tmp_path), "--from-osm", str(packed), "--json"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    assert content["problems"] == content["notes"] == []
    assert "main road: 1001 1002 1003, host's lanes 0 1 0" in content["found"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TEXT.replace("motorway_link", "track"), "no on-ramp found"),
        (TEXT.replace("motorway", "residential"), "extract.osm: no motorway, no trunk road"),
        (TEXT[: len(TEXT) // 2], "netconvert refuses it"),
        ("<net/>", "its root is <net>, not <osm>; a SUMO net goes with --from-net"),
        ("\0\0\0\rOSMHeader", "osmium cat"),
        ("", "not XML"),
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm version="0.6">&a;</osm>', "it has a document type"),
    ],
)
def test_what_is_no_extract_with_a_ramp_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        ramp_from_osm(tmp_path / "mine", write(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "mine").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--from-osm", "a", "--from-net", "b"], "not both"),
        (["--link", "2001"], "give --from-net or --from-osm, too"),
        (["--from-osm", str(EXTRACT), "--lanes", "3"], "--lanes comes from the file"),
        (["--from-osm", str(EXTRACT), "--downstream", "300"], "give --downstream 3"),
        (["--from-osm", str(EXTRACT), "--link", "3001"], "edge '3001' joins no road"),
    ],
)
def test_options_that_do_not_go_together(tmp_path: Path, words: list[str], message: str) -> None:
    result = CliRunner().invoke(app, ["new", "mine", "--out", str(tmp_path), *words])
    assert isinstance(result.exception, UserError)
    assert message in str(result.exception)


def test_the_side_of_traffic_is_read_from_the_links_or_given(tmp_path: Path) -> None:
    mirrored = re.sub(r'lat="48\.(\d+)"', lambda m: f'lat="{96.4 - float(f"48.{m[1]}"):.7f}"', TEXT)
    extract = write(tmp_path, mirrored)
    ramp = Ramp.load(ramp_from_osm(tmp_path / "mine", extract))
    assert ramp.auxiliary_end == pytest.approx(240.0, abs=2.0)
    said = "Traffic keeps left: 1 of 1 links lie on the left of their roads."
    assert read_ramp_file(tmp_path / "mine").sources["side"] == said
    assert "side" not in read_ramp_file(ramp_from_osm(tmp_path / "plain", EXTRACT)).sources
    line = refused("ramp", "new", "other", "--right-hand", cwd=tmp_path)
    assert "--left-hand and --right-hand are for --from-osm" in line


def test_a_comma_in_a_path_that_sumo_would_split(tmp_path: Path) -> None:
    place = tmp_path / "a,b"
    place.mkdir()
    extract = write(place, TEXT)
    assert "a,b/extract.osm: SUMO takes a comma for the end" in refused(
        "ramp", "new", "x", "--from-osm", extract, cwd=tmp_path
    )
    assert "a,b/x: SUMO takes a comma for the end" in refused("ramp", "new", "x", "--out", place, cwd=tmp_path)
