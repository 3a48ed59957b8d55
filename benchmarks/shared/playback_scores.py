"""Free runs of models along flights, held against what was measured, with the metric of the nano-drone benchmark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.playback import player
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Observer

HORIZON = 50
SHOWN = (1, 10, 50)
SIGNALS = ("position", "velocity", "attitude", "body_rate")
SYMBOLS = dict(zip(SIGNALS, ("p", "v", "R", "ω"), strict=True))


class Score(NamedTuple):
    """Means of the norms of errors of free runs, how many runs there are, and how many diverged.

    Shape (horizon, 4), m, m/s, rad, rad/s: of position, velocity, attitude (geodesic), body rate.
    """

    mae: Array
    windows: int
    diverged: int = 0

    @property
    def sums(self) -> Array:
        """Sums over the horizons, shape (4,)."""
        return np.asarray(self.mae.sum(axis=0))


class Runs(NamedTuple):
    """Predicted less measured position, velocity, rotation vector and rate along one flight, and how many diverged.

    Shape (run, horizon, 4, 3); the rotation vector in the body frame of the measured attitude.
    """

    errors: Array
    diverged: int = 0


def score(runs: Sequence[Runs]) -> Score:
    """Take means over all runs of all flights, leaving out what is NaN; NaN where nothing is known."""
    norms = np.concatenate([np.linalg.norm(run.errors, axis=3) for run in runs])
    known = np.isfinite(norms).sum(axis=0)
    mae = np.where(known, np.nansum(norms, axis=0) / np.maximum(known, 1), np.nan)
    return Score(mae, len(norms), sum(run.diverged for run in runs))


def runs_with_past(model: VehicleModel, observer: Observer, flight: PlaybackFlight) -> Runs:
    """Play a forecast that uses the past back from every sample of a flight."""
    starts = flight.starts(HORIZON, 1)
    runs = player.free_runs(replace(player.player_of(model, flight), observer=observer), flight, starts, HORIZON)
    return Runs(runs.errors, int(np.sum(runs.diverged >= 0)))


def by_run(runs: Sequence[Runs], first: int) -> Score:
    """Take means over the runs of each flight from a sample on, and then the mean of the flights."""
    scores = [score([Runs(run.errors[first:], run.diverged)]) for run in runs]
    windows, diverged = (sum(getattr(each, name) for each in scores) for name in ("windows", "diverged"))
    return Score(np.mean([each.mae for each in scores], axis=0), windows, diverged)


def free_runs(model: VehicleModel, flight: PlaybackFlight, every: int = 1, horizon: int = HORIZON) -> Runs:
    """Play a model back, without correction, from every n-th sample of a flight from which the horizon fits."""
    starts = flight.starts(horizon, every)
    errors, diverged = player.free_runs(player.player_of(model, flight), flight, starts, horizon)
    return Runs(errors, int(np.sum(diverged >= 0)))


def nothing_moves(flight: PlaybackFlight, every: int = 1, horizon: int = HORIZON) -> Runs:
    """Let all stay as it is at the start: position, velocity, attitude, rate."""
    return Runs(_less_measured(flight, flight.starts(horizon, every), horizon, np.zeros(3), np.zeros(3)))


def rate_stays(flight: PlaybackFlight, every: int = 1, horizon: int = HORIZON) -> Runs:
    """Let rate and velocity stay, so that the body goes on turning and moving."""
    starts, motion = flight.starts(horizon, every), flight.motion
    return Runs(_less_measured(flight, starts, horizon, motion.velocity[starts], motion.rate[starts]))


def _less_measured(flight: PlaybackFlight, starts: IntArray, horizon: int, velocity: Array, rate: Array) -> Array:
    """Move on at a constant velocity and turn at a constant rate; velocity and rate themselves stay."""
    motion, errors = flight.motion, np.empty((len(starts), horizon, 4, 3))
    rotation, zero = Rotation.from_matrix(motion.rotation), np.zeros((len(starts), 3))
    for step in range(horizon):
        at, later = starts + step + 1, (step + 1) * motion.period
        turned = rotation[starts] * Rotation.from_rotvec(zero + later * rate)
        errors[:, step, 0] = motion.position[starts] + later * velocity - motion.position[at]
        errors[:, step, 1] = motion.velocity[starts] - motion.velocity[at]
        errors[:, step, 2] = (rotation[at].inv() * turned).as_rotvec()
        errors[:, step, 3] = motion.rate[starts] - motion.rate[at]
    return errors


def as_published(flights: Sequence[PlaybackFlight], runs: Sequence[Runs]) -> list[Runs]:
    """Hold runs against what the published script of the nano-drone benchmark holds them against.

    It lays the windows of all flights end to end before it looks for the sample h steps later, so that the last windows
    of a flight meet the beginning of the next; of the last flight they meet nothing and are left out (NaN).
    """
    held = [Runs(run.errors.copy(), run.diverged) for run in runs]
    for index, run in enumerate(held):
        windows, horizon = run.errors.shape[:2]
        window, step = np.nonzero(np.arange(windows)[:, None] + np.arange(horizon) >= windows)
        if index + 1 == len(flights):
            run.errors[window, step] = np.nan
            continue
        at, beyond = window + step + 1, window + step - windows + 1
        run.errors[window, step] = _moved(run.errors[window, step], flights[index], at, flights[index + 1], beyond)
    return held


def _moved(errors: Array, flight: PlaybackFlight, at: Array, other: PlaybackFlight, there: Array) -> Array:
    """Turn errors against samples of a flight into errors against samples of another."""
    here, next_ = flight.motion, other.motion
    predicted = Rotation.from_matrix(here.rotation[at]) * Rotation.from_rotvec(errors[:, 2])
    turn = Rotation.from_matrix(next_.rotation[there]).inv() * predicted
    return np.stack(
        [
            errors[:, 0] + here.position[at] - next_.position[there],
            errors[:, 1] + here.velocity[at] - next_.velocity[there],
            turn.as_rotvec(),
            errors[:, 3] + here.rate[at] - next_.rate[there],
        ],
        axis=1,
    )
