"""A scalar loop that keeps one sumo in a process of its own and talks to it by TraCI over a socket.

The wait for the connection (traci retries once a second) is taken out of the time.
"""

import sys
from contextlib import redirect_stdout
from time import perf_counter
from typing import Any

import sumolib
import traci
from encounter import add_routes, drive, main, sumo_options


def run(task: Any, cases: list[Any]) -> tuple[list[tuple[bool, int]], float]:
    """All cases in one simulation, call by call through the socket."""
    begin = perf_counter()
    with redirect_stdout(sys.stderr):  # traci prints its attempts to connect
        traci.start([sumolib.checkBinary("sumo"), *sumo_options(task)], stdout=sys.stderr)
    waited = perf_counter() - begin
    add_routes(traci, task)
    outcomes = [drive(traci, task, case) for case in cases]
    traci.close()
    return outcomes, waited


if __name__ == "__main__":
    main(run)
