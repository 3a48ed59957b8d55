"""How well controllers tracked a plan, and at what effort."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.control.plan import Plan
from cpfls_cli.control.track import Tracked, wrapped


@dataclass(frozen=True)
class Scores:
    """Tracking errors at the samples of the plan; NaN for a controller that lost its vehicle.

    Attributes
    ----------
    error : array, shape (controller, samples, 3), rad
        Planned less flown angles; NaN only from the loss on.
    settled_from : float, s
        Since the first sample: when the initial error has died down, at the latest half-way.
    rms, largest : array, shape (controller, 3), rad
        Root mean square and largest size of all samples.
    settled_rms, settled_largest : array, shape (controller, 3), rad
        Of those after that time.
    effort : array, shape (controller, 3), N m, body frame
        Root mean square of the torque.
    clipped : array, shape (controller,)
        Share of the commands that the actuators could not follow.
    lost : array, shape (controller,), s
        Time of the loss; NaN where none.
    """

    error: Array
    settled_from: float
    rms: Array
    largest: Array
    settled_rms: Array
    settled_largest: Array
    effort: Array
    clipped: Array
    lost: Array


def scores(plan: Plan, tracked: Tracked, settling_time: float) -> Scores:
    """Score what controllers did.

    Parameters
    ----------
    plan : Plan
    tracked : Tracked
    settling_time : float, s
        In which a perfect controller forgets an initial error.
    """
    error = wrapped(plan.attitude - tracked.attitude)
    alive = np.all(np.isfinite(error), axis=2)
    lost = np.where(alive.all(axis=1), np.nan, plan.time[np.argmin(alive, axis=1)])
    sampled = error[:, :: plan.parts]
    since = plan.time[:: plan.parts] - plan.time[0]
    settled_from = min(settling_time, 0.5 * float(since[-1]))
    settled = sampled[:, since >= settled_from]
    return Scores(
        error=sampled,
        settled_from=settled_from,
        rms=_rms(sampled),
        largest=np.max(np.abs(sampled), axis=1),
        settled_rms=_rms(settled),
        settled_largest=np.max(np.abs(settled), axis=1),
        effort=_rms(tracked.body_torque),
        clipped=np.sum(tracked.clipped, axis=1) / np.maximum(np.sum(alive, axis=1), 1),
        lost=lost,
    )


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=1)))
