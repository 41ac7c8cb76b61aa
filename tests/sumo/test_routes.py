from pathlib import Path

import libsumo
import numpy as np
import pytest
from lxml import etree

from merge_cosim.core.encounter import Encounters
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.routes import write_encounter
from merge_cosim.sumo.vehicle_types import ROLE


def one_encounter(merge_position: float) -> Encounters:
    text, none = np.array(["one"]), np.zeros(1, dtype=bool)
    numbers = (np.array([value]) for value in (-95.0, 21.5, 4.5, -12.0, 17.25, 6.0, merge_position))
    return Encounters(text, text, text, text, *numbers, np.array([-1]), none, none)


@pytest.mark.parametrize(
    ("name", "host", "merging"),
    [
        ("designed", ("main_in_0", 405.0), ("ramp_0", 488.0)),
        ("us101", ("main_in_0", 447.0), ("weave_0", 30.0)),
        ("i80", ("main_in_0", 428.0), ("merge_0", 11.0)),
    ],
)
def test_sumo_starts_with_the_encounter(
    tmp_path: Path, name: str, host: tuple[str, float], merging: tuple[str, float]
) -> None:
    ramp = Ramp.load(name)
    config = write_encounter(tmp_path, ramp, one_encounter(ramp.merging_point), 0)
    libsumo.start(["sumo", "--configuration-file", str(config), "--no-step-log", "--no-warnings"])
    try:
        libsumo.simulationStep()
        for car, (lane, position), speed, length in (("host", host, 21.5, 4.5), ("merging", merging, 17.25, 6.0)):
            assert libsumo.vehicle.getLaneID(car) == lane
            assert libsumo.vehicle.getLanePosition(car) == pytest.approx(position)
            assert libsumo.vehicle.getSpeed(car) == speed
            assert libsumo.vehicle.getLength(car) == length
            assert libsumo.vehicletype.getParameter(car, ROLE) == car
    finally:
        libsumo.close()


def test_the_folder_stands_alone(tmp_path: Path) -> None:
    config = write_encounter(tmp_path / "case", Ramp.load("us101"), one_encounter(42.0), 0)
    values = [element.get("value", "") for element in etree.parse(config).iter()]
    assert sorted(p.name for p in config.parent.iterdir()) == [
        "encounter.rou.xml",
        "encounter.sumocfg",
        "ramp.toml",
        "us101.net.xml",
        "view.xml",
    ]
    assert not any("/" in value for value in values)
