"""SUMO's options: the value of each, and a profile of options for each kind of run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from merge_cosim.core.files import without_comma
from merge_cosim.core.units import DT

Options = Mapping[str, str]
"""Values by SUMO's long names, without the dashes."""

STEP: Options = {"step-length": str(DT)}
NO_TELEPORT: Options = {"time-to-teleport": "-1"}
"""A vehicle that waits is never teleported."""
CONTACTS: Options = {
    "collision.action": "warn",
    "collision.mingap-factor": "0",
    "collision.check-junctions": "false",
}
"""A contact is reported where bumpers meet; SUMO does nothing else about it."""
NO_INTERNAL_LINKS: Options = {"no-internal-links": "true"}
"""No lanes inside junctions, so that a path is as long as its edges."""
SILENT: Options = {"no-step-log": "true", "no-warnings": "true"}
QUIET: Options = {**SILENT, "duration-log.disable": "true", "xml-validation": "never"}

TILES: Options = {**STEP, **NO_TELEPORT, **CONTACTS, **QUIET}
"""Encounters on copies of a ramp, whose net has no lanes inside junctions, or on the ramp's own net."""
LOGGED: Options = {**TILES, **NO_INTERNAL_LINKS}
"""All cars of a recording."""
TRAFFIC: Options = {
    **STEP,
    **CONTACTS,
    **NO_INTERNAL_LINKS,
    **QUIET,
    "device.tripinfo.probability": "1",
    "verbose": "false",
    "duration-log.statistics": "false",
}
"""A user's configuration with SUMO's own traffic; teleports are as the configuration has them, and are counted."""
BACKGROUND: Options = {**STEP, **NO_TELEPORT, "collision.action": "none", **NO_INTERNAL_LINKS, **SILENT}
"""SUMO's own traffic without commands."""
WRITTEN: Options = {**NO_TELEPORT, "collision.action": "warn", **NO_INTERNAL_LINKS}
"""The section `processing` of the configurations that are written for users."""

_CONDITIONS = (*STEP, *NO_TELEPORT, *CONTACTS, *NO_INTERNAL_LINKS)


@dataclass(frozen=True)
class SumoOptions:
    """The options of one run.

    Attributes:
        net: The net that SUMO runs on.
        seed: SUMO's seed.
        extra: Further options as SUMO's command line has them.
        profile: The options that are always set in runs of this kind.
        configuration: A configuration that names the net and the routes; None for a net without routes.
    """

    net: Path
    seed: int = 0
    extra: tuple[str, ...] = ()
    profile: Options = field(default_factory=lambda: TILES)
    configuration: Path | None = None

    @property
    def file(self) -> Path:
        """The file that SUMO is started with, which error lines name."""
        return self.configuration or self.net

    @property
    def conditions(self) -> dict[str, str]:
        """The options that a running SUMO must have been started with to be used in place of one of our own."""
        return {name: self.profile[name] for name in _CONDITIONS if name in self.profile} | dict(NO_INTERNAL_LINKS)

    def arguments(self) -> list[str]:
        """The options as SUMO's command line has them."""
        kind = "net-file" if self.configuration is None else "configuration-file"
        return [*words({kind: without_comma(self.file), "seed": self.seed, **self.profile}), *self.extra]


def words(options: Mapping[str, object]) -> list[str]:
    """Options by name as words of a command line."""
    return [word for name, value in options.items() for word in (f"--{name}", str(value))]


REAL_TIME = "delay", "1000"
"""sumo-gui's option for real time, which it counts in milliseconds per simulated second."""


def delay_option(milliseconds: float) -> tuple[str, str]:
    """The option of sumo-gui for a pause with every step, which it counts per simulated second."""
    return "--delay", str(milliseconds / DT)
