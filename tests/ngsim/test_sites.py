"""A site is a file: what `site.toml` says, and the one line that names a mistake in it."""

from pathlib import Path

import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FOOT
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.sites import FILE_NAME, shipped_sites, site

OWN = """
title = "A merge"
[lanes]
host = [1, 11]
ramp = [2]
shared = [-1]
[recording]
format = "columns"
gore = -100.0
unit = "ft"
rate = 5.0
point = "centre"
columns = { vehicle_id = "id", frame = "k", y = "s", speed = "v", lane = "lane", length = "length" }
[pairs]
hold = 0.2
"""


def written(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in OWN
    folder.mkdir(exist_ok=True)
    (folder / FILE_NAME).write_text(OWN.replace(old, new, 1) if old else OWN)
    return folder


def test_shipped_sites_are_found_by_name_and_by_the_portals_spelling():
    i80, us101 = shipped_sites()
    assert site("us101") is us101
    assert site("US-101") is us101
    assert site("i80") is i80
    assert (us101.name, us101.host_lane, us101.side_lanes, us101.gore_y) == ("us101", 5, (6, 7, 8), 613 * FOOT)
    assert (i80.name, i80.host_lane, i80.side_lanes, i80.gore_y) == ("i80", 6, (7,), 591 * FOOT)


def test_a_folder_is_a_site(tmp_path):
    own = site(written(tmp_path / "merge"))
    assert (own.name, own.host_lane, own.gore_y, own.source) == ("merge", 1, -100 * FOOT, "recorded")
    assert (own.layout.rate, own.layout.to_front, own.layout.unit) == (5.0, 0.5, FOOT)
    assert own.layout.required == ["id", "k", "s", "v", "lane", "length"]


def test_what_a_scenario_sets_stands_above_the_site(tmp_path):
    pairs = site(written(tmp_path / "merge")).pairs
    assert PairRules().over(pairs) == PairRules(hold=0.2)
    assert PairRules(min_window=1.0).over(pairs) == PairRules(hold=0.2, min_window=1.0)
    assert PairRules(hold=0.5).over(pairs).hold == 0.5


def test_an_unknown_site_names_the_choices():
    with pytest.raises(UserError, match=r"unknown site 'a9': choose i80, us101, or a folder with site\.toml"):
        site("a9")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[lanes]", "[lanes", "not valid TOML"),
        ('title = "A merge"', "", "title: missing; every site needs it"),
        ("shared", "shard", "lanes.shard: unknown key; did you mean 'shared'?"),
        ("ramp = [2]", "ramp = [11]", "lanes: lane 11 is named twice; each lane has one part"),
        ("ramp = [2]", "ramp = []", "lanes.ramp: Tuple should have at least 1 item"),
        ('y = "s", ', "", "recording: columns.y is missing: name the file's column"),
        ("frame", "fame", "recording: columns.fame is no canonical column; these are vehicle_id, part, frame"),
        (', length = "length"', "", "recording: point = 'centre' needs columns.length, to find the front"),
        (
            'format = "columns"',
            'format = "ngsim"',
            "recording: 'columns' is known where format = 'ngsim': leave it out",
        ),
        ('unit = "ft"', 'unit = "yd"', "recording.unit: Input should be 'm' or 'ft'"),
        ("rate = 5.0", "rate = 0", "recording.rate: Input should be greater than 0"),
        ("hold = 0.2", "hald = 0.2", "pairs.hald: unknown key; did you mean 'hold'?"),
        ("hold = 0.2", "smoothing_window = 10", "pair rules: smoothing_window is 10"),
    ],
)
def test_a_mistake_in_the_file_is_one_clear_line(tmp_path, old, new, message):
    folder = written(tmp_path, old, new)
    with pytest.raises(UserError) as caught:
        site(folder)
    assert str(caught.value).startswith(f"{folder / FILE_NAME}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_without_the_file_says_what_a_site_is(tmp_path):
    with pytest.raises(UserError, match=r"site\.toml: cannot be read .*; a site is a folder with site\.toml"):
        site(tmp_path)
