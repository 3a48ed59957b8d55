"""The entry of the program: small, so that an interrupt finds it ready before anything heavy loads."""

from __future__ import annotations

from cpfls_cli.cli.interrupts import interruptible, leave_on_interrupt
from cpfls_cli.cli.threads import use_one_thread


def run() -> None:
    """Run the command line."""
    leave_on_interrupt()
    use_one_thread()
    from cpfls_cli.cli.app import app

    with interruptible():
        app(prog_name="cpfls")
