"""Interrupts: once, at moments when they must wait, and where Python cannot raise them."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.machinery import ExtensionFileLoader
from types import FrameType
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

STDERR = 2
"""Number of a process's standard error."""
SAME = 1.0
"""Interrupts within this time are one [s]: both the terminal and a program around this one may send it."""
LATER = 0.02
"""How long an interrupt waits that came where Python cannot raise it [s]."""


def interrupted_once(end: Callable[[], object] = lambda: None) -> None:
    """Let the first Ctrl-C raise KeyboardInterrupt, and a later one end this process at once, with status 130.

    Where Python can only print an exception, as in a finalizer or in what runs after a fork, the first comes again; so
    it does while an extension module is being loaded, which may drop it.

    Args:
        end: What else a later one ends.
    """
    first: list[float] = []
    printed = sys.unraisablehook

    def interrupted(_: int, frame: FrameType | None) -> None:
        if not first and _amid_extension(frame):
            come_again()
        elif not first:
            first.append(time.monotonic())
            raise KeyboardInterrupt
        elif time.monotonic() - first[0] > SAME:
            end()
            os._exit(130)

    def lost(found: Any) -> None:
        if not issubclass(found.exc_type, KeyboardInterrupt):
            printed(found)
            return
        first.clear()
        come_again()

    def come_again() -> None:
        main = threading.main_thread().ident
        again = threading.Timer(LATER, lambda: signal.pthread_kill(main or 0, signal.SIGINT))
        again.daemon = True
        again.start()

    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, interrupted)
        sys.unraisablehook = lost


def _amid_extension(frame: FrameType | None) -> bool:
    """Whether a module that is not Python's is being loaded."""
    loads = (ExtensionFileLoader.create_module.__code__, ExtensionFileLoader.exec_module.__code__)
    while frame is not None and frame.f_code not in loads:
        frame = frame.f_back
    return frame is not None


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


@contextmanager
def interrupts_ignored(*blocked: signal.Signals) -> Iterator[None]:
    """Processes that are started here ignore Ctrl-C: this process gets it afterwards, and ends them.

    Args:
        blocked: Signals that they get once they unblock them. A forked process has this one's handlers at first, and
            loses what these raise while it starts.
    """
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield  # Windows has no masks, and no other thread is interrupted
        return
    from multiprocessing import resource_tracker

    with open(os.devnull, "wb") as nothing, starts_silently(nothing):
        resource_tracker.ensure_running()  # it would be started with the first process, and unblock the signal there
    with held_back(signal.SIGINT, *blocked):  # for threads without the mask
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, *blocked})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def starts_silently(file: IO[bytes]) -> Iterator[Connection | None]:
    """Processes that are started here print to a file on standard error, as where they lack memory for their start.

    Yields:
        This process's own standard error, to be given to a process, which can then turn to it; None on Windows.
    """
    if os.name != "posix":
        yield None
        return
    from multiprocessing.connection import Connection

    own = os.dup(STDERR)
    try:
        os.dup2(file.fileno(), STDERR)
        with Connection(os.dup(own), readable=False) as connection:
            yield connection
    finally:
        os.dup2(own, STDERR)
        os.close(own)
