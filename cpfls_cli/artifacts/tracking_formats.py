"""What a flight holds of the attitude controllers that were compared on it."""

from __future__ import annotations

from cpfls_cli.artifacts.spec import DatasetSpec

TRACKING: tuple[DatasetSpec, ...] = ()
"""All optional: only a flight under a computed torque has them."""
