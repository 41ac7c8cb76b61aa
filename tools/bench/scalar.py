"""A scalar loop that keeps one libsumo open: each case's two cars are added and taken out again."""

from typing import Any

import libsumo
from encounter import add_routes, drive, main, sumo_options


def run(task: Any, cases: list[Any]) -> tuple[list[tuple[bool, int]], float]:
    """All cases in one simulation."""
    libsumo.start(["sumo", *sumo_options(task)])
    add_routes(libsumo, task)
    outcomes = [drive(libsumo, task, case) for case in cases]
    libsumo.close()
    return outcomes, 0.0


if __name__ == "__main__":
    main(run)
