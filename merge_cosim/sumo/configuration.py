"""A SUMO configuration, as SUMO itself reads it: its net, its route files, the vehicles in them."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import sumolib
from lxml import etree

from merge_cosim.core.errors import UserError
from merge_cosim.core.programs import run_program
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import DT, TOLERANCE
from merge_cosim.core.xml_file import read_xml
from merge_cosim.ramps.create.describe import describe_ramp
from merge_cosim.ramps.definition import FILE_NAME, read_ramp_file
from merge_cosim.ramps.picture import PICTURE
from merge_cosim.sumo.vehicle_types import ROLE

DEMAND = ("vehicle", "trip", "flow", "person", "personFlow", "container", "containerFlow")
"""Elements that put something into the simulation."""
TYPES = ("vType", "vTypeDistribution")
"""Elements that say of which kind a vehicle is."""
READING = 60.0
"""Longest time for SUMO to read a configuration [s]."""
DEFAULT_TYPE = "DEFAULT_VEHTYPE"
"""SUMO's own passenger car."""


@dataclass(frozen=True)
class Configuration:
    """The parts of a `.sumocfg` that this package uses.

    Attributes:
        file: The file.
        net: Its net, beside which lies a `ramp.toml`.
        routes: Its route files.
        additional: Its additional files.
        begin: Its begin [s].
        end: Its end [s]; inf if it names none.
        step: Its step [s]; `DT` if it names none. What is run has steps of `DT` all the same.
    """

    file: Path
    net: Path
    routes: tuple[Path, ...]
    additional: tuple[Path, ...]
    begin: float
    end: float
    step: float = DT

    @classmethod
    def read(cls, file: Path) -> Configuration:
        """Read it.

        Raises:
            UserError: A file is missing, SUMO refuses the configuration, or the net is not that of a ramp.
        """
        if not file.is_file():
            raise UserError(f"{file}: no such file")
        read_xml(file)  # SUMO would follow the entities of a document type, perhaps without an end
        options = dict(_options(file.absolute(), file.stat().st_mtime_ns, str(file)))
        nets, routes, additional = (
            tuple(file.parent / os.path.expandvars(name.strip()) for name in options.get(key, "").split(",") if name)
            for key in ("net-file", "route-files", "additional-files")
        )
        for key, files in (("net-file", nets), ("route-files", routes or additional)):
            if not files:
                raise UserError(f"{file}: no <{key} value=.../>")
        if options.get("mesosim") == "true":
            raise UserError(f"{file}: mesosim: SUMO's mesoscopic model has no lanes to merge between; leave it out")
        for each in (*nets, *routes, *additional):
            if not each.is_file():
                raise UserError(f"{file}: {each}: no such file")
        _require_ramp(file, nets[0])
        step = _seconds(options.get("step-length", "1"), file)  # SUMO's own default
        end = _seconds(options.get("end", "-1"), file)
        return cls(
            *(file, nets[0], routes, additional, _seconds(options.get("begin", "0"), file)),
            *(end if end >= 0 else math.inf, step),
        )

    def note_step(self) -> None:
        """Say, on standard error, that another step than `DT` is not taken."""
        if abs(self.step - DT) > TOLERANCE:
            default = " (SUMO's default)" if self.step == 1.0 else ""
            line = f"{self.file}: step-length {self.step:g} s{default} is not used: a cycle is {DT:g} s"
            print(line, file=sys.stderr)

    @property
    def files(self) -> tuple[Path, ...]:
        """All of them."""
        return (self.file, self.net, *self.routes, *self.additional)

    def vehicles(self) -> Iterator[etree._Element]:
        """All elements of the files that put in a vehicle or a person."""
        return self._elements(*DEMAND)

    def names_role(self, role: str) -> bool:
        """Whether any vehicle or type has the role."""
        return any(one.get("key") == ROLE and one.get("value") == role for one in self._elements("param"))

    def hosts(self, host: str) -> tuple[str, ...]:
        """Ids of the vehicles and flows that are hosts on any route: by their role, or by the name `host`."""
        types = {kind.get("id") for kind in self._elements("vType") if _is_host(kind)}
        return tuple(
            one.get("id", "")
            for one in self._elements("vehicle", "trip", "flow")
            if _is_host(one) or one.get("type") in types or (one.tag != "flow" and one.get("id") == host)
        )

    def lengths(self) -> dict[str, float]:
        """Lengths of the vehicle types that have one [m]."""
        return {
            kind.get("id", ""): float(kind.get("length", "")) for kind in self._elements("vType") if kind.get("length")
        }

    def departures(self) -> dict[str, float]:
        """Departure of each vehicle with a time of its own [s], without flows."""
        found = {}
        for one in self._elements("vehicle", "trip"):
            try:
                found[one.get("id", "")] = float(sumolib.miscutils.parseTime(one.get("depart", "")))
            except ValueError:  # triggered by something else
                continue
        return found

    def require(self, host: str) -> None:
        """Refuse a host's name that is not in the files.

        Args:
            host: Id of a vehicle, a flow or a type.

        Raises:
            UserError: It is not, or it names several types.
        """
        ids = {element.get("id", ""): element.tag for element in self._elements(*DEMAND, *TYPES)}
        if ids.get(host) == "vTypeDistribution":
            members = [one for one in self._elements("vTypeDistribution") if one.get("id") == host]
            named = [each.get("id", "") for one in members for each in one.iter("vType")]
            named += [name for one in members for name in one.get("vTypes", "").split()]
            raise UserError(
                f"{self.file}: host = '{host}': it stands for several types; choose one: {', '.join(named)}"
            )
        if host in ids or host == DEFAULT_TYPE or host.rpartition(".")[0] in ids:
            return
        raise UserError(
            f"{self.file}: host = '{host}': no vehicle, flow or type of its files has this id"
            f"{did_you_mean(host, [name for name, tag in ids.items() if tag in ('flow', 'vType')][:20])}"
        )

    def _elements(self, *tags: str) -> Iterator[etree._Element]:
        for file in (*self.routes, *self.additional):
            yield from parse(file).iter(*tags)


def parse(file: Path, parents: tuple[Path, ...] = ()) -> etree._Element:
    """Root of an XML file, which may be compressed with gzip; with the content of included files in place.

    Args:
        file: The file.
        parents: The files that include it.

    Raises:
        UserError: A file cannot be read (see `read_xml`), or includes itself.
    """
    if file in parents:
        raise UserError(f"{file}: it includes itself")
    root = read_xml(file)
    for include in list(root.iter("include")):
        parent = include.getparent()
        if parent is not None:
            parent.replace(include, parse(file.parent / include.get("href", ""), (*parents, file)))
    return root


def _is_host(element: etree._Element) -> bool:
    return any(one.get("key") == ROLE and one.get("value") == "host" for one in element.iter("param"))


@lru_cache(maxsize=8)
def _options(file: Path, changed: int, named: str) -> tuple[tuple[str, str], ...]:
    """The options of a configuration by SUMO's long names: SUMO knows several names of each.

    Args:
        file: The configuration.
        changed: Time of its last change, so that a changed file is read again.
        named: What error lines call it.
    """
    # SUMO runs in the file's folder, so that relative names stay as they are.
    command = [sumolib.checkBinary("sumo"), "-c", file.name, "--save-configuration", "-"]
    done = run_program(command, READING, Path(named), cwd=file.parent)
    if done.returncode:
        lines = done.stderr.decode(errors="replace").splitlines()
        reason = " ".join(line.removeprefix("Error: ").strip() for line in lines if "Quitting" not in line)
        raise UserError(f"{named}: SUMO cannot read it: {reason or 'no reason given'}")
    root = etree.fromstring(done.stdout[done.stdout.index(b"<?xml") :])
    return tuple((str(one.tag), one.get("value", "")) for one in root.iter(etree.Element) if "value" in one.attrib)


def _require_ramp(file: Path, net: Path) -> None:
    """Describe a net that has no `ramp.toml` beside it, with a line on standard error; refuse a net without a ramp."""
    if not (net.parent / FILE_NAME).is_file():
        try:
            folder = describe_ramp(net)
        except UserError as error:
            raise UserError(f"{file}: no {FILE_NAME} beside its net says where the on-ramp is: {error}") from None
        print(f"{file}: the on-ramp was inferred: {folder / FILE_NAME}, drawn in {PICTURE} there", file=sys.stderr)
    own = net.parent / read_ramp_file(net.parent).net
    if own.name != net.name and own.is_file():
        raise UserError(f"{file}: {net.parent / FILE_NAME} is that of {own.name}, not of the net {net.name}")


def _seconds(text: str, file: Path) -> float:
    """A time of SUMO [s]: seconds, or [days:]hours:minutes:seconds."""
    try:
        return float(sumolib.miscutils.parseTime(text))
    except ValueError:
        raise UserError(f"{file}: '{text}' is no time") from None
