"""What a search for the structure of a vehicle leaves next to its output, as `vehicle` keeps it."""

from __future__ import annotations

from cpfls_cli.search import KeptStructures
from cpfls_cli.stage import Run, stage


@stage(KeptStructures, title="Unfinished search for a vehicle", study=True)
def vehicle_checkpoint(run: Run) -> KeptStructures:
    """Leave it: those commands do."""
    raise NotImplementedError(run.output)
