"""A failure of workers, apart from one of the data that they work on."""

from __future__ import annotations

from cpfls_cli.errors import ComputationError


class WorkerError(ComputationError):
    """Workers cannot be had, vanished, or failed for a reason that is not in the data."""
