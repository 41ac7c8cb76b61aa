"""A session in a SUMO of the user's own; tests/cli/test_attach.py runs whole cases in one."""

import socket
import subprocess

import numpy as np
import pytest
import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.tiles import TiledWorld
from merge_cosim.sumo.attach import Address, AttachedSession
from merge_cosim.sumo.options import SumoOptions, words
from merge_cosim.sumo.start import connection_kept


@pytest.mark.parametrize("text", ["8813", ":8813", "here:", "here:0", "here:65536", "here:x", "here:-1"])
def test_an_address_is_host_and_port(text):
    with pytest.raises(UserError, match="not HOST:PORT"):
        Address.parse(text)
    assert Address.parse("here:8813") == Address("here", 8813)


def test_the_end_of_sumo_in_mid_run_is_reported():
    ramp = Ramp.load("designed")
    with socket.socket() as free:
        free.bind(("localhost", 0))
        address = Address("localhost", free.getsockname()[1])
    conditions = words(SumoOptions(ramp.net).conditions)
    command = [sumolib.checkBinary("sumo"), "-n", ramp.net, "--remote-port", str(address.port), *conditions]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        world = TiledWorld(ramp, 1, open_session=lambda options: AttachedSession(options, address), tiled=False)
    finally:
        running.kill()
        running.wait()

    def one_cycle():
        with connection_kept():
            world.command(np.zeros((2, 1)))
            world.step()

    with pytest.raises(UserError, match="SUMO has ended before the case was over"):
        one_cycle()
    world.close()
