"""Signals that wait for the end of a block."""

import signal

import pytest

from merge_cosim.core.signals import held_back


def test_an_interrupt_waits_for_the_end_of_the_block() -> None:
    done = []

    def interrupted() -> None:
        with held_back(signal.SIGINT):
            signal.raise_signal(signal.SIGINT)
            done.append("the rest of the block")

    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done
    assert signal.getsignal(signal.SIGINT) is handler
