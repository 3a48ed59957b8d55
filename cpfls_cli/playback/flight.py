"""Flights as playback needs them: motion, logged rotor speeds, stretches without pauses, and where windows start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.playback.kernels import Motion
from cpfls_cli.playback.rotors import Hold


@dataclass(frozen=True, kw_only=True)
class PlaybackFlight:
    """A flight on a uniform clock, in stretches without pauses.

    Attributes
    ----------
    name : str
    motion : Motion
        Zero, and no rotation, where the flight does not know it.
    speed : array, shape (time, rotor), rad/s
        Measured, or commanded.
    hold : {"linear", "previous"}
        What a speed is between samples.
    stretches : tuple of slice
    has_attitude, has_velocity, has_position : bool
        Whether they were measured. Without attitude or velocity rotation alone is played back.
    """

    name: str
    motion: Motion
    speed: Array
    hold: Hold
    stretches: tuple[slice, ...]
    has_attitude: bool = True
    has_velocity: bool = True
    has_position: bool = True

    def __len__(self) -> int:
        return len(self.speed)

    @property
    def translates(self) -> bool:
        """Whether velocity is simulated."""
        return self.has_attitude and self.has_velocity

    def starts(self, horizon: int, every: int) -> IntArray:
        """List every n-th sample from which a horizon fits into its stretch.

        Parameters
        ----------
        horizon, every : int
            Samples.

        Raises
        ------
        InputError
            If no stretch is that long.
        """
        found = [np.arange(part.start, part.stop - horizon, every) for part in self.stretches]
        starts = np.concatenate([np.zeros(0, dtype=np.int64), *found]).astype(np.int64)
        if not len(starts):
            longest = max((part.stop - part.start for part in self.stretches), default=0)
            raise InputError(
                f"{self.name}: a horizon of {horizon} samples is longer than its longest stretch without a pause, "
                f"{longest} samples; ask for a shorter one"
            )
        return starts
