from pathlib import Path

import numpy as np
import pytest
from trajectory_tables import Car, steady, table

from merge_cosim.ngsim.data import load_trajectories
from merge_cosim.ngsim.pairing.checks import replay_logged_host, without_failures
from merge_cosim.ngsim.pairing.episodes import read_episodes
from merge_cosim.ngsim.pairing.pairs import Paired, extract_pairs
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.sites import site

US101 = site("us101")

MERGE = [6] * 30 + [5] * 60
"""Merges in frame 30; a host 10 m behind with the same speed reaches the merging point in cycle 37."""


def pair(*cars: Car) -> Paired:
    return extract_pairs(table(*cars), US101, PairRules(), "ngsim")


@pytest.mark.parametrize(
    ("frames", "complete", "cut", "extended"),
    [
        ([5] * 90, True, False, False),
        ([5] * 68, True, False, False),  # scored in cycles 37 to 67
        ([5] * 67, False, False, True),
        ([5] * 68 + [4] * 9, True, False, False),
        ([5] * 67 + [4] * 9, False, True, False),
        ([5] * 35, False, False, True),  # ends before it arrives
        ([5] * 33 + [4] * 9, False, True, False),  # leaves before it arrives
    ],
)
def test_how_far_the_logs_carry(frames: list[int], complete: bool, cut: bool, extended: bool) -> None:
    paired = pair(steady(1, MERGE, at=0), steady(2, frames, at=-10))
    outcome = replay_logged_host(paired.encounters)
    assert (outcome.complete[0], outcome.cut[0], outcome.extended[0]) == (complete, cut, extended)
    assert not outcome.failed[0]
    assert without_failures(paired) is paired


@pytest.mark.parametrize(("gap", "failed"), [(0.0, False), (-0.001, True)])
def test_bodies_that_touch_do_not_overlap(gap: float, failed: bool) -> None:
    paired = pair(steady(1, MERGE, at=0), steady(2, [5] * 90, at=-4 - gap))
    assert replay_logged_host(paired.encounters).failed[0] == failed


def test_a_failing_pair_is_listed_and_excluded() -> None:
    paired = pair(steady(1, MERGE, at=0), steady(2, [5] * 90, at=-2), steady(3, [5] * 90, at=30))
    checked = without_failures(paired)
    assert checked.encounters.case.tolist() == ["r-1.1-h3.1"]
    assert checked.rejected == {"logged_host_fails": ("r-1.1-h2.1",)}


def test_a_log_that_ends_goes_on_at_its_last_speed() -> None:
    slow = 15 * 0.1 * np.arange(40) + 10
    quick = np.concatenate([3 * 0.1 * np.arange(40) + 49])
    near = pair(steady(1, MERGE[:40], at=0), Car(2, [5] * 40, quick))
    assert replay_logged_host(near.encounters).failed.tolist() == [True]  # 9 m ahead at the change, 12 m/s slower
    assert not replay_logged_host(near.encounters, horizon=0.3).failed[0]
    far = pair(steady(1, MERGE[:40], at=0), Car(2, [5] * 40, slow))
    assert not replay_logged_host(far.encounters).failed[0]


def test_real_logged_hosts(data_dir: Path) -> None:
    table = load_trajectories(data_dir, US101)
    assert table is not None
    fragments = extract_pairs(table, US101, PairRules(), "ngsim").encounters
    assert fragments.case[replay_logged_host(fragments).failed].tolist() == []
    episodes = read_episodes(data_dir / "us101_merging_episodes.parquet", US101, PairRules(), first=0).encounters
    assert episodes.case[replay_logged_host(episodes).failed].tolist() == ["episode-45-0.1-h3.1"]
