"""Interrupts that wait for the end of a block, come twice, or come where Python cannot raise them."""

import signal
import subprocess
import sys

import pytest

from merge_cosim.core.signals import held_back


def test_an_interrupt_waits_for_the_end_of_the_block() -> None:
    done = []

    def interrupted() -> None:
        with held_back(signal.SIGINT):
            signal.raise_signal(signal.SIGINT)
            done.append("the rest of the block")

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert done
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


ALONE = "import os, signal, sys, time; from merge_cosim.core import signals; strike = lambda: os.kill(os.getpid(), 2); "


@pytest.mark.parametrize(
    ("script", "status", "printed"),
    [
        # The first is an exception, one at the same time is the same one, and a later one ends the process at once.
        (
            "signals.interrupted_once(lambda: print('ended', flush=True))\ntry: strike()\n"
            "except KeyboardInterrupt: print('first', flush=True)\nstrike(); signals.SAME = 0.0; strike(); print('no')",
            130,
            "first\nended\n",
        ),
        # In a finalizer Python could only print it.
        (
            "signals.interrupted_once()\nclass Held:\n  def __del__(self): strike(); time.sleep(0)\n"
            "try: Held(); time.sleep(20)\nexcept KeyboardInterrupt: print('heard')",
            0,
            "heard\n",
        ),
        # While an extension module is being loaded, which drops what is raised.
        (
            "signals.interrupted_once()\nimport abc, numpy\nregister = abc.ABCMeta.register\n"
            "def once(*both):\n  abc.ABCMeta.register = register; strike(); return register(*both)\n"
            "abc.ABCMeta.register = once\nimport lxml.etree\nprint(abc.ABCMeta.register is register, flush=True)\n"
            "try: time.sleep(20)\nexcept KeyboardInterrupt: print('heard')",
            0,
            "True\nheard\n",
        ),
        # While the command line is being loaded.
        (
            "import merge_cosim.__main__ as program\nclass Finder:\n  def find_spec(self, name, *_):\n"
            "    if name == 'merge_cosim.cli.main': strike()\nsys.meta_path.insert(0, Finder()); program.main()",
            130,
            "",
        ),
    ],
    ids=["twice", "finalizer", "extension", "loading"],
)
def test_an_interrupt_is_heard_once_and_leaves_no_traceback(script: str, status: int, printed: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ALONE + script],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # background jobs ignore it
    )
    assert (done.stdout, done.stderr) == (printed, "")
    assert done.returncode in (status, -signal.SIGINT if status == 130 else status)
