"""Give a model's torque along the recorded motion, identify again, and see whether the same inertia comes back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.data import TorqueData, TorqueSource
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.validation.bands import Curves
from cpfls_cli.validation.timeline import TimeBlocks, time_blocks

# Share of the largest inertia that rounding may take a curve out of a band of no width.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class SimulatedTorque:
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


@dataclass(frozen=True)
class RoundTrip:
    """The inertia matrix identified from torque that a model gave.

    Attributes
    ----------
    inertia : array, shape (curves, points, 3, 3), kg m^2
        Along the curves of the model.
    inside : array, shape (3, 3)
        Share of the points that training visited where it lies within the model's band; NaN for an entry that is zero
        everywhere, and where no point was visited.
    """

    inertia: Array
    inside: Array


def round_trip(
    training: TorqueSource,
    learned: TorqueSource,
    settings: IdentificationSettings,
    model: Model,
    curves: Curves,
    rng: np.random.Generator,
) -> RoundTrip:
    """Identify a model again from torque that it gave itself.

    The torque of the model along the training motion gets the model's own errors as noise, those of each block of
    samples times +1 or -1: noise as strong and as correlated as in the flight, none where the model misses nothing. It
    is larger than the errors by what the fit has followed of it.

    Nothing is integrated in time: the motion is the recorded one, and only the torque is evaluated anew.

    The partitions are the model's: a search would find others that fit as well, and the question here is whether the
    samples determine the inertia, not the breakpoints. The ridge weight is chosen anew, and its pull towards a rigid
    body is shared by both models: a model that it pulled too far comes back all the same.

    Parameters
    ----------
    training, learned : TorqueSource
        What the model was identified from.
    settings : IdentificationSettings
    model : Model
    curves : Curves
    rng : numpy.random.Generator

    Raises
    ------
    ComputationError
        If the simulation gives no finite model.
    """
    again = _identified_again(_simulated(training, learned, settings, model, rng), settings, model)
    inertia = again.inertia(curves.attitude.reshape(-1, 3)).value.reshape(curves.inertia.shape)
    return RoundTrip(inertia, _inside(inertia, curves))


def _simulated(
    training: TorqueSource,
    learned: TorqueSource,
    settings: IdentificationSettings,
    model: Model,
    rng: np.random.Generator,
) -> tuple[TorqueSource, TorqueSource]:
    blocks = time_blocks(training, settings.validation.block_s)
    rows, parameters = 3 * len(learned), len(model.coefficients)
    strength = np.sqrt(rows / max(rows - parameters, 1))
    factor = strength * rng.choice([-1.0, 1.0], len(blocks.starts) + 1)
    whole = SimulatedTorque(training, model, blocks, factor)
    return whole, whole if learned is training else SimulatedTorque(learned, model, blocks, factor)


def _identified_again(
    sources: tuple[TorqueSource, TorqueSource], settings: IdentificationSettings, model: Model
) -> Model:
    solver = model_evaluator(*sources, settings).solver
    fit = solver.fit(model.partitions)
    if fit is None:
        raise ComputationError("the simulation of the model gives no finite model")
    exact, _ = solver.exact(model.partitions, fit)
    return replace(model, coefficients=exact.coefficients, rigid_body=exact.rigid_body)


def _inside(inertia: Array, curves: Curves) -> Array:
    visited, slack = ~curves.outside, _ROUNDING * float(np.max(np.abs(curves.inertia)))
    inside = (inertia >= curves.low - slack) & (inertia <= curves.high + slack)
    zero = np.all(curves.inertia == 0.0, axis=(0, 1)) & np.all(inertia == 0.0, axis=(0, 1))
    if not visited.any():
        return np.full((3, 3), np.nan)
    return np.where(zero, np.nan, np.mean(inside[visited], axis=0))
