"""Interrupts: one line and an exit code, never a traceback."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from types import FrameType
from typing import Any

_MESSAGE = b"cpfls: error: interrupted: no half-written file is left\n"

_A_MOMENT_S = 0.02
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_Handler = Callable[[int, FrameType | None], None]


def leave_on_interrupt() -> None:
    """Exit at once on an interrupt: while the program loads, when there is nothing to clean up."""
    _install(_leave)


@contextmanager
def interruptible() -> Iterator[None]:
    """Turn an interrupt into `KeyboardInterrupt`, and that or the error it causes into an exit code.

    The exit code is 128 plus the number of the signal: 130 after Ctrl-C, 143 after a request to terminate.
    """
    received: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if received:
            _leave(number, frame)
        received.append(number)
        raise KeyboardInterrupt(number)

    _install(stop)
    unraisable = sys.unraisablehook
    sys.unraisablehook = _sent_again(received, unraisable)
    try:
        yield
    except SystemExit as end:
        # A command that was asked to stop may have come to an end itself, and said what it has kept.
        if received and (end.code != 128 + received[0] or _is_of_interrupt(end)):
            _leave(received[0], None)
        raise
    except BaseException:
        # A compiled module whose import is interrupted may raise an error of its own in place of the interrupt.
        if received:
            _leave(received[0], None)
        raise
    finally:
        sys.unraisablehook = unraisable
        _install(signal.SIG_DFL)


def _is_of_interrupt(error: BaseException | None) -> bool:
    return error is not None and (isinstance(error, KeyboardInterrupt) or _is_of_interrupt(error.__context__))


def _sent_again(received: list[int], otherwise: Callable[[Any], object]) -> Callable[[Any], None]:
    """Send an interrupt again that came in a destructor or a callback, where the interpreter swallows it."""

    def hook(unraisable: Any) -> None:
        if received and issubclass(unraisable.exc_type, KeyboardInterrupt):
            Timer(_A_MOMENT_S, os.kill, (os.getpid(), received.pop())).start()
        else:
            otherwise(unraisable)

    return hook


@contextmanager
def deferred_interrupts() -> Iterator[Callable[[], int | None]]:
    """Record the first interrupt as a request to stop, which the work inside polls; the next one acts as outside.

    What it yields gives the number of the signal received, or None; also afterwards.
    """
    received: list[int] = []
    outside = {number: signal.getsignal(number) for number in _SIGNALS}

    def note(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        received.append(number)
        _restore(outside)

    _install(note)
    try:
        yield lambda: received[0] if received else None
    finally:
        _restore(outside)


def _leave(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
    os.write(2, _MESSAGE)
    os._exit(128 + number)


def _install(handler: _Handler | signal.Handlers) -> None:
    for number in _SIGNALS:
        # A shell starts background work with interrupts ignored; that is the user's wish.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _restore(handlers: dict[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
