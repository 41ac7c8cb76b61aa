"""The two freeway sites of NGSIM with an on-ramp: which lanes count, and how a row's site is told."""

from dataclasses import dataclass

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FOOT


@dataclass(frozen=True)
class Site:
    """One freeway site.

    Attributes:
        name: Name on the command line and in the canonical table, such as `us101`.
        title: Name for people.
        location: Value of the portal's `Location` column.
        ramp_lanes: Lanes from which cars merge.
        host_lane: The main lane that they merge into.
        exit_lanes: Lanes that go on from `ramp_lanes` to an off-ramp.
        gore_y: Local_Y [m] where the on-ramp joins the main road.
        length: Length of the study area [m].
        global_x, global_y: Range of the global coordinates (California State Plane, NAD83, US survey feet) that holds
            the study area with some margin.
    """

    name: str
    title: str
    location: str
    ramp_lanes: tuple[int, ...]
    host_lane: int
    exit_lanes: tuple[int, ...]
    gore_y: float
    length: float
    global_x: tuple[float, float]
    global_y: tuple[float, float]

    @property
    def side_lanes(self) -> tuple[int, ...]:
        """The lanes beside the main road, which are one path: on-ramp, auxiliary lane, off-ramp."""
        return self.ramp_lanes + self.exit_lanes


US101 = Site(
    name="us101",
    title="US-101, Los Angeles",
    location="us-101",
    ramp_lanes=(6, 7),
    host_lane=5,
    exit_lanes=(8,),
    gore_y=613 * FOOT,
    length=640.0,
    global_x=(6_450_700.0, 6_453_200.0),
    global_y=(1_871_450.0, 1_873_750.0),
)

I80 = Site(
    name="i80",
    title="I-80, Emeryville",
    location="i-80",
    ramp_lanes=(7,),
    host_lane=6,
    exit_lanes=(),
    gore_y=591 * FOOT,
    length=503.0,
    global_x=(6_041_500.0, 6_044_500.0),
    global_y=(2_130_500.0, 2_136_500.0),
)

SITES = (US101, I80)


def site(name: str) -> Site:
    """Return the site called `name` (also as the portal spells it).

    Raises:
        UserError: No such site.
    """
    for known in SITES:
        if name.strip().lower() in (known.name, known.location):
            return known
    raise UserError(f"unknown site {name!r}: choose {' or '.join(known.name for known in SITES)}")
