"""A SUMO that somebody else has started."""

import socket
import subprocess

import sumolib

from merge_cosim.ramps.ramp import Ramp

CONDITIONS = {
    "step-length": "0.1",
    "no-internal-links": "true",
    "time-to-teleport": "-1",
    "collision.action": "warn",
    "collision.mingap-factor": "0",
}


class Running:
    """A SUMO that listens on a free port, and that ends with the block."""

    def __init__(self, ramp, *further, cwd=None, **conditions):
        self.cwd = cwd
        with socket.socket() as free:
            free.bind(("localhost", 0))
            self.port = free.getsockname()[1]
        words = [w for name, value in (CONDITIONS | conditions).items() for w in (f"--{name}", value)]
        net = ("-n", Ramp.load(ramp).net, "--remote-port", str(self.port))
        self.command = [sumolib.checkBinary("sumo"), *net, *words, *further]

    def __enter__(self):
        self.process = subprocess.Popen(
            self.command, cwd=self.cwd, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        return f"localhost:{self.port}"

    def __exit__(self, *_):
        try:
            assert self.process.wait(30) == 0  # it ends with its last client
        finally:
            self.process.kill()
