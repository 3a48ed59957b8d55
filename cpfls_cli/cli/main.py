"""The entry of the program: small, so that an interrupt finds it ready before anything heavy loads."""

from __future__ import annotations

import os

from cpfls_cli.cli.interrupts import interruptible, leave_on_interrupt

_THREAD_LIMITS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def run() -> None:
    """Run the command line."""
    leave_on_interrupt()
    use_one_thread()
    from cpfls_cli.cli.app import app

    with interruptible():
        app(prog_name="cpfls")


def use_one_thread() -> None:
    """Limit linear algebra to one thread; its libraries read the limit when they load, so call this before."""
    os.environ.update(dict.fromkeys(_THREAD_LIMITS, "1"))
