"""The entry of the program: small, so that an interrupt finds it ready before anything heavy loads."""

from __future__ import annotations

import atexit
import gc
import os
import sys

from cpfls_cli.artifacts.patience import end_what_hangs
from cpfls_cli.cli.interrupts import interruptible, leave_on_interrupt

_THREAD_LIMITS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


# Python asks for garbage after 700 new objects: too often where libraries load, and make thousands that stay.
_OBJECTS_PER_COLLECTION = 10_000


def run() -> None:
    """Run the command line."""
    gc.set_threshold(_OBJECTS_PER_COLLECTION, *gc.get_threshold()[1:])
    # The end of the process frees all memory: to look for garbage first takes a tenth of the time of a short command.
    atexit.register(gc.freeze)
    _open_standard_streams()
    leave_on_interrupt()
    end_what_hangs()
    use_one_thread()
    # To look for plugins of the validating library among all packages takes a tenth of the time of a short command.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    from typer import Exit

    from cpfls_cli.cli.stages import app
    from cpfls_cli.cli.terminal import messages_for_errors

    with interruptible():
        try:
            # The library prints help itself, which fails where the output does.
            with messages_for_errors():
                app(prog_name="cpfls")
        except Exit as end:
            sys.exit(end.exit_code)


def _open_standard_streams() -> None:
    """Open those that the caller closed: else the next file opened takes their place, and is printed into."""
    for name, mode in {"stdin": "r", "stdout": "w", "stderr": "w"}.items():
        if getattr(sys, name) is None:
            # It gets the lowest number that is free, which is that of the stream.
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def use_one_thread() -> None:
    """Limit linear algebra to one thread; its libraries read the limit when they load, so call this before."""
    os.environ.update(dict.fromkeys(_THREAD_LIMITS, "1"))
