"""How long HDF5 may read a file: another process says where it never comes back, and a timer ends it.

In a damaged file HDF5 may follow addresses in a circle. It holds the interpreter then, so that neither a thread nor a
handler of signals runs. A seal shows damage, but not where somebody has sealed it again.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, ClassVar

from cpfls_cli.errors import InputError, visible
from cpfls_cli.files import longest_read_s

if TYPE_CHECKING:
    import subprocess

_WATCH = """
import os, queue, signal, sys, threading, time

received = queue.Queue()

def listen():
    while chunk := os.read(0, 65536):
        received.put(chunk)
    os._exit(0)

threading.Thread(target=listen, daemon=True).start()
wait, path, rest = None, "", b""
while True:
    try:
        chunk = received.get(timeout=wait)
    except queue.Empty:
        break
    # A handler of signals that finds the interpreter held leaves the number of the signal here.
    stopped = bool(wait) and any(number in chunk for number in STOPS)
    *lines, rest = (rest + chunk.translate(None, STOPS)).split(b"\\n")
    for line in lines:
        seconds, _, name = line.decode("utf-8", "surrogateescape").partition(" ")
        wait, path = float(seconds) or None, name
        why = f"damaged: HDF5 did not finish reading it within {seconds} s"
    if stopped and wait:
        wait, why = GRACE, "interrupted while HDF5 was reading it"
os.write(2, f"cpfls: error: {path}: {why}\\n".encode("utf-8", "surrogateescape"))
if not stopped:
    # It ends by its own timer, with an exit code; the thread that listens then ends this process.
    time.sleep(GRACE)
os.kill(int(sys.argv[1]), getattr(signal, "SIGKILL", signal.SIGTERM))
os._exit(0)
"""
_STOPS = bytes([signal.SIGINT, signal.SIGTERM])
_GRACE_S = 3.0
"""After a signal, in which a sound file is read to the end of one dataset and the program ends by itself."""
_GOES_ON = b"0 \n"
_AFTER_S = 1.0
"""By which the program ends later than the other process says why."""

_MONOTONIC, _BY_THREAD = 1, 2
"""A clock, and the way in which a timer of POSIX calls a function, as Linux numbers them."""


class _Watch:
    """The other process, started where the first file is read; nothing is watched where it cannot be."""

    def __init__(self) -> None:
        self.wanted = False
        self.depth = 0
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def on(self) -> bool:
        """Whether there is such a process, or shall be."""
        return self.wanted or self._process is not None

    def tell(self, line: bytes) -> None:
        """Say what is read and how long that may take, or that it has come to an end."""
        pipe = self._pipe()
        if pipe is not None:
            with suppress(OSError):
                os.write(pipe.fileno(), line)

    def wake(self) -> int | None:
        """Let signals reach the other process; give what they reached before, None where that cannot be changed."""
        pipe = self._pipe()
        if pipe is None or os.name != "posix":
            return None
        try:
            return signal.set_wakeup_fd(pipe.fileno(), warn_on_full_buffer=False)
        except (ValueError, OSError):
            # Not the main thread, which alone gets signals.
            return None

    def _pipe(self) -> IO[bytes] | None:
        if self._process is None and self.wanted:
            # It loads slowly, and no file is read by `cpfls config`.
            import subprocess

            self.wanted = False
            code = _WATCH.replace("STOPS", repr(_STOPS)).replace("GRACE", repr(_GRACE_S))
            with suppress(OSError, ValueError):
                self._process = subprocess.Popen(
                    [sys.executable, "-I", "-S", "-c", code, str(os.getpid())],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    bufsize=0,
                    # Ctrl-C is for the program; the end of the pipe ends this one.
                    start_new_session=True,
                )
                assert self._process.stdin is not None, "asked for"
                with suppress(OSError, AttributeError):
                    os.set_blocking(self._process.stdin.fileno(), False)
                atexit.register(self._end)
        return None if self._process is None else self._process.stdin

    def _end(self) -> None:
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
            self._process.wait()


class _Timer:
    """Ends the program with the exit code of wrong input, whatever holds the interpreter.

    Linux calls `_exit` in a thread of its own, which needs no interpreter; elsewhere the other process ends it.
    """

    def __init__(self) -> None:
        self._timer: Any = None
        self._set: Callable[..., object] | None = None
        if not sys.platform.startswith("linux"):
            return
        import ctypes

        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)

            class Event(ctypes.Structure):
                _fields_: ClassVar = [
                    ("value", ctypes.c_void_p),
                    ("signal", ctypes.c_int),
                    ("notify", ctypes.c_int),
                    ("function", ctypes.c_void_p),
                    ("rest", ctypes.c_char * 56),
                ]

            timer, ends = ctypes.c_void_p(), ctypes.cast(library._exit, ctypes.c_void_p).value
            event = Event(value=InputError.exit_code, notify=_BY_THREAD, function=ends)
            if library.timer_create(_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0:
                self._timer, self._set = timer, library.timer_settime

    def ends_in(self, seconds: float) -> None:
        """Begin to count; 0 stops that."""
        if self._set is not None:
            import ctypes

            # Seconds and nanoseconds between two ends, and to the first.
            self._set(self._timer, 0, (ctypes.c_long * 4)(0, 0, int(seconds), int(1e9 * (seconds % 1.0))), None)


_WATCHED = _Watch()
_timer_of = cache(lambda _process: _Timer())
"""Of a process: one that was forked has none of its parent's."""


def end_what_hangs() -> None:
    """Let files be watched from now on: for a program of its own, which may be ended."""
    _WATCHED.wanted = True


@contextmanager
def patient(path: Path) -> Iterator[None]:
    """Read a file with HDF5 in here, and nothing else."""
    watch = _WATCHED
    if watch.depth or not watch.on:
        yield
        return
    watch.depth += 1
    seconds = longest_read_s(path.stat().st_size)
    watch.tell(f"{seconds:.0f} {visible(str(path)).replace(chr(10), ' ')}\n".encode("utf-8", "surrogateescape"))
    before, timer = watch.wake(), _timer_of(os.getpid())
    timer.ends_in(seconds + _AFTER_S)
    try:
        yield
    finally:
        timer.ends_in(0.0)
        if before is not None:
            signal.set_wakeup_fd(before)
        watch.tell(_GOES_ON)
        watch.depth -= 1
