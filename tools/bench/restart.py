"""A scalar loop that starts SUMO (libsumo) anew for every case."""

from typing import Any

import libsumo
from encounter import add_routes, drive, main, sumo_options


def run(task: Any, cases: list[Any]) -> tuple[list[tuple[bool, int]], float]:
    """One simulation per case."""
    outcomes = []
    for case in cases:
        libsumo.start(["sumo", *sumo_options(task)])
        add_routes(libsumo, task)
        outcomes.append(drive(libsumo, task, case))
        libsumo.close()
    return outcomes, 0.0


if __name__ == "__main__":
    main(run)
