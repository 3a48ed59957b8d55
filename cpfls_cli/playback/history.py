"""A forecast that uses the past: a disturbance observed until a run starts, which acts on and fades after it.

The model takes one step from each measured sample. What it misses of a step is the torque and force e that must have
acted over it beside its own. They are taken for a disturbance d, which is followed from 0 on over the steps h of the
past, about and along each axis with a rate r and a memory T,

    d' = exp(-h / T) (d + (1 - exp(-r h)) (e - d)).

It is an observer whose rate and velocity are corrected to what was measured at each sample, and whose second gain
integrates the disturbance. From the start on nothing is observed: ``d' = exp(-h / T) d`` acts on the body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.playback.flight import Body, PlaybackFlight
from cpfls_cli.result import about, result


@result
class Observer:
    """Observes torque and force that a model misses, about and along the body axes."""

    rate: Array = about(
        "at which what the model misses is taken up: torque x y z, force x y z", "6", unit="1/s", frame="body (FLU)"
    )
    memory_s: Array = about(
        "time constant with which the disturbance fades", "6", unit="s", frame="body (FLU)", least=0.0
    )
    past_s: float = about("how much of the flight before a start is used", unit="s")

    def samples(self, period: float) -> int:
        """Count the steps of the past."""
        return round(self.past_s / period)

    def weights(self, period: float) -> Array:
        """Weigh the steps of the past, the latest last: the disturbance is their sum, shape (step, 6)."""
        gain, keep = 1.0 - np.exp(-period * self.rate), np.exp(-period / self.memory_s)
        later = np.arange(self.samples(period))[::-1, None]
        return np.asarray(keep * gain * (keep * (1.0 - gain)) ** later)

    def fading(self, period: float, horizon: int) -> Array:
        """Tell what is left of the disturbance over each step of a run, shape (horizon, 6)."""
        return np.asarray(np.exp(-period * np.arange(horizon)[:, None] / self.memory_s))


def past_of(flight: PlaybackFlight, starts: IntArray, samples: int) -> tuple[IntArray, Array]:
    """List the steps before each start, and which of them are in its stretch: earlier ones hold nothing of it.

    Parameters
    ----------
    starts : array of int, shape (run,)
    samples : int
        Steps of the past.

    Returns
    -------
    steps : array of int, shape (run, samples)
        Samples at which they begin, the latest last; the first of the stretch where there is none.
    known : array, shape (run, samples)
        1, or 0.
    """
    begins = np.zeros(len(starts), dtype=np.int64)
    for stretch in flight.stretches:
        begins[(starts >= stretch.start) & (starts < stretch.stop)] = stretch.start
    steps = starts[:, None] + np.arange(-samples, 0)
    return np.maximum(steps, begins[:, None]), (steps >= begins[:, None]).astype(float)


def missed_before(
    flight: PlaybackFlight, starts: IntArray, samples: int, single_steps: Callable[[IntArray], Array], body: Body
) -> Array:
    """Give what a model misses of the steps before each start, shape (run, samples, 6), N m and N, body frame.

    0 where there is none. `single_steps` gives the errors of steps that begin at samples, shape (step, 4, 3), see
    `errors_of_runs`.
    """
    steps, known = past_of(flight, starts, samples)
    first = int(steps.min(initial=int(starts.min())))
    taken = np.arange(first, int(starts.max()))
    missed = np.zeros((len(taken) + 1, 6))
    if len(taken):
        errors, period, rotation = single_steps(taken), flight.motion.period, flight.motion.rotation[taken]
        missed[:-1, :3] = -errors[:, 3] @ body.inertia / period
        if flight.translates:
            missed[:-1, 3:] = -body.mass / period * np.einsum("tji,tj->ti", rotation, errors[:, 1])
    return np.asarray(missed[steps - first] * known[:, :, None])
