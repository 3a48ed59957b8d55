"""Data to identify from: a motion and the torque that drove it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from cpfls_cli.arrays import Array, IntArray, require_columns
from cpfls_cli.errors import ComputationError
from cpfls_cli.regressor.regressor import Motion

TRAINING = "training"
CHUNK = 65536
"""Samples worked on at a time: 7 MB of motion and torque, whatever the length of a flight."""

# Between one flight and the next on their common time: far longer than any embargo.
_PAUSE = 1e4


class TorqueSource(Protocol):
    """Samples in the order of time, in memory or not, that can be read chunk by chunk any number of times."""

    def __len__(self) -> int:
        """Count the samples."""
        ...

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, `CHUNK` at a time."""
        ...


@dataclass(frozen=True)
class TorqueData:
    """Samples of one flight, in the order of time.

    Attributes
    ----------
    time : array, shape (samples,), s
    torque : array, shape (samples, 3), N m
        Generalised torque on the Euler angles.
    setpoints : mapping of str to array, shape (samples, column)
        What was asked for; NaN where nothing was.
    """

    time: Array
    motion: Motion
    torque: Array
    setpoints: Mapping[str, Array] = field(default_factory=dict)

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
        asked = {name: values[samples] for name, values in self.setpoints.items()}
        return TorqueData(self.time[samples], self.motion[samples], self.torque[samples], asked)

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, `CHUNK` at a time."""
        for start in range(0, len(self), CHUNK):
            yield self[start : start + CHUNK]


@dataclass(frozen=True)
class Flights:
    """Several flights, one after the other with a pause between."""

    flights: tuple[TorqueSource, ...]

    def __len__(self) -> int:
        """Count the samples."""
        return sum(len(flight) for flight in self.flights)

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, `CHUNK` at a time; no chunk holds samples of two flights."""
        end = 0.0
        for number, flight in enumerate(self.flights):
            offset = end if number else 0.0
            for data in flight.chunks():
                yield replace(data, time=data.time + offset)
                end = float(data.time[-1]) + offset + _PAUSE


@dataclass(frozen=True)
class OtherTorque:
    """The motion of a source with another torque.

    Attributes
    ----------
    torque : callable
        From samples to their torque, shape (samples, 3), N m.
    """

    source: TorqueSource
    torque: Callable[[TorqueData], Array]

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.source)

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, chunk by chunk."""
        for data in self.source.chunks():
            yield replace(data, torque=self.torque(data))


def joined(flights: Sequence[TorqueSource]) -> TorqueSource:
    """Join several flights to one source.

    Returns
    -------
    TorqueSource
        A single flight stays as it is.
    """
    return flights[0] if len(flights) == 1 else Flights(tuple(flights))


def gathered(source: TorqueSource, samples: IntArray) -> TorqueData:
    """Gather some samples in memory.

    Parameters
    ----------
    samples : array of int
        Indices, ascending.
    """
    parts, start = [], 0
    for data in source.chunks():
        first, last = np.searchsorted(samples, [start, start + len(data)])
        parts.append(data[samples[first:last] - start])
        start += len(data)
    motion = [np.concatenate([getattr(part.motion, name) for part in parts]) for name in vars(parts[0].motion)]
    return TorqueData(
        np.concatenate([part.time for part in parts]), Motion(*motion), np.concatenate([part.torque for part in parts])
    )


def sample_times(source: TorqueSource) -> Array:
    """Gather the times of all samples, shape (samples,), s."""
    return np.concatenate([data.time for data in source.chunks()])


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
    """
    samples = len(time)
    end = max(round(training_share * samples), 1)
    if end >= samples:
        return Split(slice(0, samples), slice(samples, samples))
    start = int(np.searchsorted(time, time[end - 1] + embargo, side="right"))
    return Split(slice(0, end), slice(start, samples))


def axis_scale(source: TorqueSource) -> Array:
    """Compute the scale of the torque about each axis.

    Returns
    -------
    array, shape (3,), N m
        Root mean square; for an axis without torque the largest of the others, so that it does not blow up.
    """
    scale = np.sqrt(sum(np.sum(data.torque**2, axis=0) for data in source.chunks()) / len(source))
    largest = float(np.max(scale)) or 1.0
    return np.where(scale > 1e-9 * largest, scale, largest)
