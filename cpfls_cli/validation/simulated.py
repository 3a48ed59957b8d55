"""Torque that a model misses along a motion, and torque that a model would have given, chunk by chunk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueData, TorqueSource
from cpfls_cli.identification.model import Model
from cpfls_cli.validation.blocks import TimeBlocks


@dataclass(frozen=True)
class Missed:
    """The motion of a source with the torque that a model misses: measured less predicted."""

    source: TorqueSource
    model: Model

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.source)

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, chunk by chunk."""
        for data in self.source.chunks():
            yield replace(data, torque=data.torque - self.model.torque(data.motion))


@dataclass(frozen=True)
class Simulated:
    """The motion of a source with the torque of a model, and what it missed as noise, turned over by block.

    Attributes
    ----------
    source : TorqueSource
    model : Model
    blocks : TimeBlocks
    factor : array, shape (blocks,)
        What the errors of each block are multiplied with.
    """

    source: TorqueSource
    model: Model
    blocks: TimeBlocks
    factor: Array

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.source)

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, chunk by chunk."""
        for data in self.source.chunks():
            predicted = self.model.torque(data.motion)
            noise = self.factor[self.blocks.number(data.time), None] * (data.torque - predicted)
            yield replace(data, torque=predicted + noise)
