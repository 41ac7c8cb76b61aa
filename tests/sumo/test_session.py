"""What a session does to a running SUMO, seen by libsumo itself."""

import math
from collections.abc import Iterator

import libsumo
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.modes import LaneChangeMode, SpeedMode
from merge_cosim.sumo.options import BACKGROUND, LOGGED, SumoOptions
from merge_cosim.sumo.session import Contact, Neighbour, Session
from merge_cosim.sumo.start import LibsumoSession, run_sumo
from merge_cosim.sumo.vehicle_types import ReleasedDrivers, VehicleType
from merge_cosim.sumo.xml import element, write_xml

RAMP = Ramp.load("us101")
KIND = VehicleType("kind", length=4.0, min_gap=1.5, tau=0.8, accel=2.1, max_speed=33.0, color="1,2,3")


@pytest.fixture
def session(tmp_path) -> Iterator[Session]:
    """SUMO on US-101's net with the type `KIND` and one car of SUMO's own, `own`."""
    depart = {"depart": "0", "departPos": "300", "departSpeed": "10"}
    own = element("vehicle", {"id": "own", "type": "kind", **depart}, element("route", {"edges": "main_in weave"}))
    write_xml(tmp_path / "own.rou.xml", element("routes", {}, KIND.element(), own))
    files = ("--route-files", str(tmp_path / "own.rou.xml"))
    running = LibsumoSession(SumoOptions(RAMP.net, extra=files, profile=LOGGED))
    running.step()
    yield running
    running.close()


def cars_at(session: Session, **positions: float) -> None:
    """Put cars of the type `KIND` on the host lane that stand where they are put."""
    for name in positions:
        session.insert(name, RAMP.main_route, "kind")
    for name, position in positions.items():
        session.place(name, "main_in_0", position, 0.0)
        session.set_speed(name, 0.0)
    session.step()


def test_a_written_type_is_what_sumo_reads(session: Session) -> None:
    kind = libsumo.vehicletype
    assert (kind.getLength("kind"), kind.getMinGap("kind"), kind.getTau("kind")) == (4.0, 1.5, 0.8)
    assert (kind.getAccel("kind"), kind.getMaxSpeed("kind"), kind.getColor("kind")) == (2.1, 33.0, (1, 2, 3, 255))


def test_the_modes_called_sumo_are_its_defaults_and_come_back_on_release(session: Session) -> None:
    def modes() -> tuple[int, int]:
        return libsumo.vehicle.getSpeedMode("own"), libsumo.vehicle.getLaneChangeMode("own")

    assert modes() == (SpeedMode.SUMO, LaneChangeMode.SUMO)
    session.take_control("own")
    assert modes() == (SpeedMode.UNCHECKED, LaneChangeMode.NONE)
    session.release("own")
    assert modes() == (SpeedMode.SUMO, LaneChangeMode.SUMO)


def test_gaps_are_from_bumper_to_bumper(session: Session) -> None:
    cars_at(session, behind=100.0, ahead=130.0)
    assert session.leader("behind", 100.0) == Neighbour("ahead", pytest.approx(26.0))
    assert session.follower("ahead", 100.0) == Neighbour("behind", pytest.approx(26.0))
    assert session.follower("behind", 100.0) == Neighbour("", math.inf)


def test_contacts_name_their_cars_in_order(session: Session) -> None:
    assert session.contacts() == []
    cars_at(session, b=100.0, a=98.0)
    assert session.contacts() == [Contact("a", "b", "main_in_0")]
    assert set(session.colliding()) == {"a", "b"}


def test_a_host_can_be_kept_on_the_main_road(session: Session) -> None:
    session.insert("leaves", ("main_in", "weave", "exit"), "kind")
    session.step()
    session.stay_on("leaves", RAMP.main_route)
    assert session.route("leaves") == RAMP.main_route


def test_what_sumo_refuses_in_a_process_of_its_own_is_one_line(tmp_path) -> None:
    missing = ("--route-files", str(tmp_path / "missing.rou.xml"))
    with pytest.raises(UserError, match=r"us101.net.xml: SUMO fails on it: .*missing.rou.xml"):
        run_sumo(SumoOptions(RAMP.net, extra=missing, profile=BACKGROUND))


def test_released_drivers_are_sumos_usual_ones_without_scatter(tmp_path) -> None:
    ReleasedDrivers("Krauss", tau=0.7).write(tmp_path / "types.add.xml")
    running = LibsumoSession(SumoOptions(RAMP.net, extra=("--additional-files", str(tmp_path / "types.add.xml"))))
    try:
        kind = libsumo.vehicletype
        assert (kind.getTau("logged"), kind.getAccel("logged"), kind.getDecel("logged")) == (0.7, 2.2, 3.0)
        assert (kind.getImperfection("logged"), kind.getSpeedDeviation("logged")) == (0.0, 0.0)
    finally:
        running.close()
