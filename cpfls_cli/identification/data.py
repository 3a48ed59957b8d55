"""Data to identify from: a motion and the torque that drove it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray, require_columns
from cpfls_cli.errors import ComputationError
from cpfls_cli.regressor.motion import Motion


@dataclass(frozen=True)
class TorqueData:
    """Samples of one flight, in the order of time.

    Attributes
    ----------
    time : array, shape (samples,), s
    motion : Motion
    torque : array, shape (samples, 3), N m
        Generalised torque on the Euler angles.
    """

    time: Array
    motion: Motion
    torque: Array

    def __post_init__(self) -> None:
        """Check shapes and values."""
        require_columns("torque", self.torque, 3)
        if not len(self.time) == len(self.motion) == len(self.torque):
            raise ComputationError(
                f"time, motion and torque have {len(self.time)}, {len(self.motion)} and {len(self.torque)} samples"
            )
        if not np.isfinite(self.torque).all():
            raise ComputationError("the torque is not finite at some samples")

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.time)

    def __getitem__(self, samples: slice | IntArray) -> TorqueData:
        """Take some of the samples."""
        return TorqueData(self.time[samples], self.motion[samples], self.torque[samples])


@dataclass(frozen=True)
class Split:
    """Training and held-out samples of one flight: contiguous parts, never single samples.

    Attributes
    ----------
    training : slice
        Leading samples.
    held_out : slice
        Trailing samples, after an embargo; may be empty.
    """

    training: slice
    held_out: slice


def split_flight(time: Array, training_share: float, embargo: float) -> Split:
    """Split a flight into a leading training part and a held-out rest.

    Parameters
    ----------
    time : array, shape (samples,), s
    training_share : float
        Share of the samples that trains, in (0, 1].
    embargo : float
        Seconds between the parts used by neither, for the memory of zero-phase filters.

    Returns
    -------
    Split
    """
    samples = len(time)
    end = max(round(training_share * samples), 1)
    if end >= samples:
        return Split(slice(0, samples), slice(samples, samples))
    start = int(np.searchsorted(time, time[end - 1] + embargo, side="right"))
    return Split(slice(0, end), slice(start, samples))


def axis_scale(torque: Array) -> Array:
    """Scale of the torque about each axis.

    Parameters
    ----------
    torque : array, shape (samples, 3), N m

    Returns
    -------
    array, shape (3,), N m
        Root mean square; for an axis without torque the largest of the others, so that it does not blow up.
    """
    scale = np.sqrt(np.mean(torque**2, axis=0))
    largest = float(np.max(scale)) or 1.0
    return np.where(scale > 1e-9 * largest, scale, largest)
