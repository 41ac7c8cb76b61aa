import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from trajectory_tables import Car, steady, table

from merge_cosim.core.encounter import Intention
from merge_cosim.ngsim.pairing import encounters as module
from merge_cosim.ngsim.pairing.encounters import at_site_point, site_encounters, site_pairs
from merge_cosim.ngsim.pairing.pairs import extract_pairs
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.stored import read_pairs, write_pairs
from merge_cosim.ngsim.pairing.summary import summarise_folder
from merge_cosim.ngsim.sites import site
from merge_cosim.scenarios.encounters import pairs_of_site
from merge_cosim.scenarios.sources import Pairs

US101, I80 = site("us101"), site("i80")


def merge_at(place: float, recording: str, hosts: int = 1) -> list[Car]:
    """A car that merges `place` [m] past the gore in frame 30, with hosts behind and ahead."""
    start = place - 45
    others = [steady(2 + i, [5] * 90, at=start + at, recording=recording) for i, at in enumerate((-10, 10)[:hosts])]
    return [steady(1, [6] * 30 + [5] * 60, at=start, recording=recording), *others]


def test_the_site_point_is_the_median_over_cars() -> None:
    cars = [*merge_at(30, "a", hosts=2), *merge_at(50, "b"), *merge_at(100, "c")]
    before = extract_pairs(table(*cars), US101, PairRules(), "ngsim").encounters
    after = at_site_point(before)
    np.testing.assert_allclose(after.merge_position, 50)
    assert after.car.tolist() == before.car.tolist()[:3]  # the third car starts at 55 m
    np.testing.assert_allclose(after.merging_station, [-65, -65, -45])
    np.testing.assert_allclose(after.host_station - after.merging_station, (before.host_station + 45)[:3])
    assert after.label.tolist() == before.label.tolist()[:3]
    assert after.log is not None
    assert before.log is not None
    assert after.log.merging_station[0][30] == pytest.approx(-20)
    np.testing.assert_allclose(after.log.host_station[2], before.log.host_station[2])
    np.testing.assert_array_equal(after.log.change_cycle, 30)


def test_stored_pairs_come_back_as_they_were(tmp_path: Path) -> None:
    paired = extract_pairs(table(*merge_at(30, "a", hosts=2), *merge_at(99, "b", hosts=0)), US101, PairRules(), "ngsim")
    write_pairs(paired, tmp_path / "pairs.parquet")
    back = read_pairs(tmp_path / "pairs.parquet")
    assert (back.merging_cars, dict(back.rejected)) == (2, {"no_host": ("us101/b/1/1",)})
    assert back.encounters.case.tolist() == paired.encounters.case.tolist()
    assert back.encounters.label.dtype == paired.encounters.label.dtype
    assert paired.encounters.log is not None
    assert back.encounters.log is not None
    again, log = back.encounters.take(np.array([1])).log, paired.encounters.log.take(np.array([1]))
    assert again is not None
    np.testing.assert_array_equal(again.merging_speed.values, log.merging_speed.values)
    np.testing.assert_array_equal(again.host_station[0], log.host_station[0])
    np.testing.assert_array_equal(again.score_until, log.score_until)
    assert list(tmp_path.iterdir()) == [tmp_path / "pairs.parquet"]


def test_slow_pairs_are_cached_until_file_or_rules_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data, cache = tmp_path / "data", tmp_path / "cache"
    data.mkdir()
    monkeypatch.setenv("MERGE_COSIM_CACHE", str(cache))
    pq.write_table(table(*merge_at(30, "a")), data / "a.parquet")
    monkeypatch.setattr(module, "CACHE_FROM", 60.0)
    site_pairs(data, US101)
    assert not list((cache / "encounters").iterdir())  # quick enough
    monkeypatch.setattr(module, "CACHE_FROM", 0.0)
    first = site_pairs(data, US101)
    assert first is not None
    (stored,) = (cache / "encounters").glob("*.parquet")
    changed = stored.stat().st_mtime_ns
    second = site_pairs(data, US101)
    assert second is not None
    assert second.encounters.case.tolist() == first.encounters.case.tolist()
    assert stored.stat().st_mtime_ns == changed
    site_pairs(data, US101, PairRules(max_window=2.5))
    os.utime(data / "a.parquet", ns=(1, 1))
    site_pairs(data, US101)
    assert len(list((cache / "encounters").glob("*.parquet"))) == 3


def test_a_surrogate_is_called_one(tmp_path: Path) -> None:
    pq.write_table(table(*merge_at(30, "a")), tmp_path / "a.parquet")
    e = site_encounters(tmp_path, US101, source="surrogate")
    assert e is not None
    assert e.source.tolist() == ["surrogate"]


def test_the_surrogate_is_distinguished_from_real_recordings_by_its_file(tmp_path: Path) -> None:
    pq.write_table(table(*merge_at(30, "a"), *merge_at(40, "surrogate_1")), tmp_path / "both.parquet")
    e = site_encounters(tmp_path, US101)
    assert e is not None
    assert sorted(e.source) == ["ngsim", "surrogate"]
    assert [one.source for one in summarise_folder(tmp_path)] == ["ngsim and surrogate"]
    real = pairs_of_site("us101", Pairs(kind="pairs", sites={"us101": "all"}), tmp_path, "ngsim")
    assert real.source.tolist() == ["ngsim"]


def test_nothing_of_a_site(tmp_path: Path) -> None:
    pq.write_table(table(*merge_at(30, "a")), tmp_path / "a.parquet")
    assert site_encounters(tmp_path, I80) is None
    (tmp_path / "empty").mkdir()
    assert site_pairs(tmp_path / "empty", US101) is None


def test_a_complete_period_needs_no_episodes(tmp_path: Path, data_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = "us101_merging_episodes.parquet"
    (tmp_path / name).write_bytes((data_dir / name).read_bytes())
    pq.write_table(table(*merge_at(30, "a"), *merge_at(40, "b")), tmp_path / "a.parquet")
    with_episodes = site_encounters(tmp_path, US101)
    assert with_episodes is not None
    assert len(with_episodes) == 2 + 71
    monkeypatch.setattr(module, "COMPLETE_CARS", 1)  # each recording has two cars
    alone = site_encounters(tmp_path, US101)
    assert alone is not None
    assert len(alone) == 2


def test_the_real_data(data_dir: Path) -> None:
    paired = site_pairs(data_dir, US101)
    assert paired is not None
    e, log = paired.encounters, paired.encounters.log
    assert log is not None
    fragments = np.char.startswith(e.case.astype(str), "us101_")
    assert (int(fragments.sum()), len(e)) == (31, 102)
    assert (len(set(e.case)), len(set(e.car))) == (102, 58)
    assert np.sum(e.label == Intention.YIELD) == 51
    rows = range(len(e))
    np.testing.assert_array_equal([log.merging_station[i][log.change_cycle[i]] for i in rows], 0)
    at_change = np.array([log.host_station[i][log.change_cycle[i]] for i in rows])
    np.testing.assert_array_equal(at_change >= 0, e.label == Intention.YIELD)
    assert np.abs(at_change).max() <= 60
    assert log.change_cycle.min() >= 20
    assert log.merging_speed.lengths.tolist() == log.merging_station.lengths.tolist()
    assert np.all(np.isfinite(log.merging_speed.values))
    assert site_encounters(data_dir, I80) is None
