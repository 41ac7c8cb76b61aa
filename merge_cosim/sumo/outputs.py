"""Files that SUMO itself writes about a run, for SUMO's own tools."""

from __future__ import annotations

import os
import re
from dataclasses import astuple, dataclass
from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT

_END = 200
"""Bytes at the end of a file in which its last tag is looked for."""

DECIMALS = 6
"""Digits after the point in these files, as in the record of every cycle; SUMO's own default is 2."""


@dataclass(frozen=True)
class SumoOutputs:
    """The files wanted; None leaves one out. SUMO completes them when the simulation is closed.

    Attributes:
        fcd: Position and speed of every car after every step (floating car data).
        ssm: Conflicts of the cars (time to collision, deceleration to avoid a crash), and in every step their braking,
            gap and time gap. No PET: SUMO finds it where lanes meet inside a junction, and tiles have no such lanes.
        lanechange: Lane changes.
        tripinfo: One entry per car, whether it has arrived or not.
        collisions: Contacts that SUMO reports.
    """

    fcd: Path | None = None
    ssm: Path | None = None
    lanechange: Path | None = None
    tripinfo: Path | None = None
    collisions: Path | None = None

    @property
    def wanted(self) -> bool:
        """Whether there is any."""
        return any(astuple(self))

    def prepare(self) -> tuple[str, ...]:
        """Make the files, empty, with their folders, and return SUMO's options that fill them.

        Raises:
            UserError: Two outputs are to go to one file, or SUMO would not take one of the names as a file.
            OSError: A file cannot be written.
        """
        options: list[str] = []
        targets: list[Path] = []
        for option, file, further in (
            ("--fcd-output", self.fcd, ("--device.fcd.begin", str(DT))),  # at 0 the cars wait to be placed
            (
                "--device.ssm.file",
                self.ssm,
                ("--device.ssm.probability", "1", "--device.ssm.measures", "TTC DRAC BR SGAP TGAP"),
            ),
            ("--lanechange-output", self.lanechange, ()),
            ("--tripinfo-output", self.tripinfo, ("--tripinfo-output.write-unfinished", "true")),
            ("--collision-output", self.collisions, ()),
        ):
            if file is None:
                continue
            target = file.resolve()
            if target in targets:
                raise UserError(f"{file}: two of SUMO's outputs are to be written to it; give each a file of its own")
            if target.exists() and not (target.is_file() or target.is_dir()):
                raise UserError(f"{file}: is no ordinary file; SUMO's output cannot be checked there")
            if ":" in str(target)[2:]:  # after a drive's letter
                raise UserError(f"{file}: SUMO takes a name with a colon for a network port; leave it out")
            targets.append(target)
            options += [option, str(target), *further]
        for target in targets:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(b"")  # SUMO's own message would name the net
        return (*options, "--precision", str(DECIMALS)) if options else ()

    def check(self) -> None:
        """Make sure that the files are whole, after the simulation was closed: SUMO reports no full disk.

        Raises:
            UserError: One is not.
        """
        for file in filter(None, astuple(self)):
            with file.open("rb") as content:
                content.seek(-min(_END, file.stat().st_size), os.SEEK_END)
                if not re.search(rb"(</[\w-]+>|/>)\s*\Z", content.read()):
                    raise UserError(f"{file}: SUMO could not write it to its end; is the disk full?")
