"""Exported vehicles flown along recorded flights: how far they end from the playback of their model, and why."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import ceil

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.export.holding import Held
from cpfls_cli.export.registry import FORMS, Exported
from cpfls_cli.playback.flight import PlaybackFlight, State
from cpfls_cli.playback.player import Course, Player, free_runs, in_the_air
from cpfls_cli.rounding import less
from tests.builders.flown_exports import FLYING, text_of

AGREES = 1e-6
"""Largest distance in SI at which the equations of a target are those that were exported."""

_FINE = 16
"""Steps of the library between two samples, and twice as many, from which steps of no length follow."""


@dataclass(frozen=True)
class Verification:
    """An exported vehicle flown along a flight.

    Attributes
    ----------
    errors : array, shape (3, 4)
        Mean norms at the end of the horizon, SI, of position, velocity, attitude and body rate: of the playback of the
        model and of the target, each less what was measured, and of the target less the playback.
    still : array, shape (4,)
        Mean norms at the end of the horizon of a state that stays as it was, less what was measured.
    step, equations, missing : array, shape (4,)
        Largest norm over all windows and horizons of what the target's step leaves; of what is left between the target
        and what was exported where steps have no length; and of what the target does not hold.
    """

    errors: Array
    still: Array
    step: Array
    equations: Array
    missing: Array
    windows: int
    horizon_s: float

    @property
    def agrees(self) -> bool:
        """Whether the target flies what was exported."""
        return bool(np.all(self.equations < AGREES))

    @property
    def beats(self) -> tuple[bool, ...]:
        """Whether the target ends nearer to what was measured than a state that stays, of each that moves at all."""
        return tuple(bool(less(own, still)) for own, still in zip(self.errors[1], self.still, strict=True) if still)


def verified(
    form: str,
    exported: Exported,
    flight: PlaybackFlight,
    model: tuple[PlaybackFlight, Player],
    horizon: int,
    windows: int,
) -> Verification:
    """Fly an exported vehicle from samples of a flight as logged, and compare it with the playback of its model.

    At most so many windows are spread over the flight; the export flies in the wind that the playback says.
    """
    flight = in_the_air(flight, model[1].wind)
    found = flight.starts(horizon, 1)
    starts = found[np.unique(np.linspace(0, len(found) - 1, windows).round().astype(int))]
    target, held, described = FLYING[form], exported.held, FORMS[form]
    course = Course(flight, starts, horizon, gravity=held.body.gravity)
    replayed = free_runs(model[1], model[0], starts, horizon).errors
    same = held.errors(flight, starts, horizon)
    otherwise = np.zeros_like(same)
    text = text_of(form, exported)
    if not target.levels:
        flown = limit = course.errors(target.fly(text, course))
        fine = same
    else:
        finer = 1 if np.isinf(target.step_s) else ceil(flight.motion.period / target.step_s - 1e-9)
        flown, limit = _limit(form, text, course, finer)
        fine = _fine(held, course)
        if described.otherwise is not None:
            # What no sum of weights is counts as not held, and not as a fault of the equations.
            otherwise = course.errors(target.fly(text, replace(course, finer=finer))) - flown
    for errors in (replayed, same, flown, limit, fine, otherwise):
        errors[:, :, ~flight.shown] = 0.0
    step = _largest(flown - limit)
    flown = flown + otherwise
    ends = [errors[:, -1] for errors in (replayed, flown, flown - replayed)]
    return Verification(
        np.array([np.linalg.norm(end, axis=2).mean(axis=0) for end in ends]),
        np.linalg.norm(_still(course)[:, -1], axis=2).mean(axis=0) * flight.shown,
        step,
        _largest(limit - fine),
        _largest(same + otherwise - replayed),
        len(starts),
        horizon * flight.motion.period,
    )


def _still(course: Course) -> Array:
    """Compare states that stay as they were with what was measured, shape (run, horizon, 4, 3)."""
    begin = (values[course.starts] for values in course.flight.motion[:4])
    return course.errors(State(*(np.repeat(values[:, None], course.horizon, axis=1) for values in begin)))


def _largest(errors: Array) -> Array:
    return np.asarray(np.linalg.norm(errors, axis=3).max(axis=(0, 1)))


def _limit(form: str, text: str, course: Course, finer: int) -> tuple[Array, Array]:
    """Fly with the step of the target and with halves of it: each takes a term of ``a h + b h^2 + ...`` out."""
    target, described = FLYING[form], FORMS[form]
    steps = [replace(course, finer=finer * 2**level) for level in range(target.levels)]
    fly = target.fly if described.otherwise is None else partial(described.otherwise.fly, own=False)
    once, *rest = found = [course.errors(fly(text, each)) for each in steps]
    for power in range(1, len(rest) + 1):
        found = [(2**power * fine - coarse) / (2**power - 1) for coarse, fine in pairwise(found)]
    return once, found[0]


def _fine(held: Held, course: Course) -> Array:
    """Play what was exported back with steps of no length: those of the midpoint rule leave ``b h^2``."""
    found = []
    for steps in (_FINE, 2 * _FINE):
        flight = replace(course, finer=steps).finer_flight
        found.append(held.errors(flight, course.starts * steps, course.horizon * steps)[:, steps - 1 :: steps])
    return np.asarray((4.0 * found[1] - found[0]) / 3.0)
