from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from merge_cosim.core.encounter import NEVER, Intention
from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.pairing.episodes import read_episodes
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.sites import site

US101 = site("us101")

FRAMES = 25


def episode(number: int, stations: dict[int, float], speed: float = 15.0) -> pd.DataFrame:
    """An episode of 25 frames; `stations` in its first one."""
    frame = np.arange(FRAMES)
    cars = [
        pd.DataFrame({"frame": frame, "car": car, "station_m": at + speed * 0.1 * frame, "speed_m_s": speed})
        for car, at in stations.items()
    ]
    return pd.concat(cars).assign(episode=number)


def write(folder: Path, *episodes: pd.DataFrame) -> Path:
    path = folder / "episodes.parquet"
    pd.concat(episodes).to_parquet(path)
    return path


def test_an_episode_ends_with_the_lane_change(tmp_path: Path) -> None:
    path = write(tmp_path, episode(30, {0: 10.0, 1: -30.0, 2: 0.0, 3: 18.0, 4: 40.0}), episode(3, {0: 0.0, 1: -9.0}))
    paired = read_episodes(path, US101, PairRules(), first=26)
    e = paired.encounters
    assert paired.merging_cars == 1
    assert e.case.tolist() == ["episode-30-0.1-h2.1", "episode-30-0.1-h3.1"]
    assert e.car.tolist() == ["us101/episode-30/0/1"] * 2
    assert e.label.tolist() == [Intention.NOT_YIELD, Intention.YIELD]
    np.testing.assert_allclose(e.merging_station, -36)
    np.testing.assert_allclose(e.host_station, [-46, -28])
    np.testing.assert_allclose(e.merge_position, 46)
    np.testing.assert_allclose(e.host_length, 5)
    assert e.length_missing.all()
    assert e.smoothed_source.all()
    assert e.log is not None
    np.testing.assert_array_equal(e.log.change_cycle, FRAMES - 1)
    np.testing.assert_array_equal(e.log.score_until, NEVER)
    assert e.log.merging_station[0][-1] == 0
    assert len(read_episodes(path, US101, PairRules(), first=0).encounters) == 3


def test_no_episode_left(tmp_path: Path) -> None:
    assert (
        len(read_episodes(write(tmp_path, episode(3, {0: 0.0, 1: 5.0})), US101, PairRules(), first=26).encounters) == 0
    )


def test_mistakes_in_the_file_are_named(tmp_path: Path) -> None:
    good = episode(30, {0: 0.0, 1: -10.0})
    faults = {
        "no column 'car'": good.drop(columns="car"),
        "'speed_m_s' holds something that is not a number": good.astype({"speed_m_s": str}).replace("15.0", "fast"),
        "'station_m' has no value in row 1": good.assign(station_m=np.nan),
        "car 0 of episode 30 goes from frame 5 to 7": good[(good.car != 0) | (good.frame != 6)],
        "car 0 of episode 30 goes from frame 0 to 0": pd.concat([good, good]),
        "episode 30 has no merging car": good[good.car != 0],
    }
    for message, table in faults.items():
        with pytest.raises(UserError, match=message):
            read_episodes(write(tmp_path, table), US101, PairRules())
    (tmp_path / "broken.parquet").write_text("no parquet")
    with pytest.raises(UserError, match=r"broken\.parquet"):
        read_episodes(tmp_path / "broken.parquet", US101, PairRules())


def test_the_published_episodes(data_dir: Path) -> None:
    path = data_dir / "us101_merging_episodes.parquet"
    paired = read_episodes(path, US101, PairRules(), first=0)
    e = paired.encounters
    assert (paired.merging_cars, len(e), len(set(e.car))) == (68, 112, 61)
    assert (np.sum(e.label == Intention.YIELD), np.sum(e.label == Intention.NOT_YIELD)) == (57, 55)
    assert paired.rejected["too_hard"] == ("episode-13-0.1-h5.1",)
    assert np.all(e.merge_position > 0)
    assert np.all(e.merge_position < US101.length - US101.gore_y)
    lenient = read_episodes(path, US101, PairRules(max_acceleration=20), first=0).encounters
    assert len(lenient) == 113
    assert len(read_episodes(path, US101, PairRules(), first=26).encounters) == 72
