"""Signals at moments when they must wait."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back(*numbers: signal.Signals) -> Iterator[None]:
    """Let the handlers of these signals run after the block instead of within it; as it is outside the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread is interrupted, and may say by what
        return
    arrived: list[int] = []
    handlers = {number: signal.signal(number, lambda which, _: arrived.append(which)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for which in arrived:
            signal.raise_signal(which)
