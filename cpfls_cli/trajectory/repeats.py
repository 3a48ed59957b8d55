"""A path flown again and again: each run the same from rest to rest, with the way back and a pause between."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, sqrt, tau

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.attitude import along, stretched_heading
from cpfls_cli.trajectory.consistency import check_samples
from cpfls_cli.trajectory.legs import Leg, evaluate_legs, move_in_space
from cpfls_cli.trajectory.planning import Trajectory
from cpfls_cli.trajectory.profile import BaseProfile
from cpfls_cli.trajectory.settings import TrajectorySettings

_AT_HOME = 1e-6
"""Distance in m, and angle in rad, at which a path ends where it begins."""

_TURN = BaseProfile(amplitude=1.0, period=1.0)
"""Shape of a turn back in yaw."""


def repeated(run: Trajectory, settings: TrajectorySettings, gravity: float) -> Trajectory:
    """Fly a path `settings.repeat` times, with a straight way back and a pause before each further run.

    Parameters
    ----------
    run : Trajectory
        At rest at its last sample.
    gravity : float, m/s^2

    Returns
    -------
    Trajectory
        Runs are equal sample by sample, but for whole turns of yaw, by which it goes on.

    Raises
    ------
    SettingError
        If the way back cannot be planned, or there are more samples than memory holds; it names the key.
    """
    count, step = settings.repeat, float(run.time[1])
    if count == 1:
        return run
    back, turn = _way_back(run, settings)
    rest = max(0.0 if back is None else back.duration, _turning_time(run, turn)) + settings.repeat_pause_s
    between = max(ceil(rest / step - 1e-6), 1)
    lap = len(run.time) - 1 + between
    check_samples((count * lap + 1) * step, step)
    resting = _between(run, back, turn, step * np.arange(1, between, dtype=np.float64), gravity)
    begins = [number * lap * step for number in range(count)]
    whole = tau * round((float(run.yaw[-1] - run.yaw[0]) - turn) / tau)
    signals = {
        name: np.concatenate([*[values, resting[name]] * (count - 1), values])
        for name, values in vars(run).items()
        if isinstance(values, np.ndarray) and name != "time"
    }
    turned = whole * np.minimum(np.arange(len(signals["yaw"])) // lap, count - 1)
    signals["yaw"] = signals["yaw"] + turned
    signals["attitude"] = signals["attitude"] + turned[:, None] * np.array([0.0, 0.0, 1.0])
    return Trajectory(
        **signals,
        time=step * np.arange(len(turned), dtype=np.float64),
        duration=begins[-1] + run.duration,
        legs=_all_legs(run, back, begins),
        maxima=run.maxima,
        runs=tuple((begin, begin + float(run.time[-1])) for begin in begins),
    )


def _way_back(run: Trajectory, settings: TrajectorySettings) -> tuple[Leg | None, float]:
    """Plan the move back to the start, None where the path ends there, and the turn left over whole ones, rad."""
    turned = float(run.yaw[-1] - run.yaw[0])
    turn = turned - tau * round(turned / tau)
    vector = run.position[0] - run.position[-1]
    if float(np.abs(vector).max()) <= _AT_HOME:
        return None, turn if abs(turn) > _AT_HOME else 0.0
    move = move_in_space(vector, settings.timing)
    return Leg(begin=0.0, start=run.position[-1], yaw=None, **vars(move)), turn


def _turning_time(run: Trajectory, turn: float) -> float:
    """Time for a turn back in yaw, s, that accelerates no more than the run does itself."""
    if not turn:
        return 0.0
    unit = stretched_heading(np.linspace(0.0, 1.0, 200), 1.0, _TURN, 1.0)
    return sqrt(abs(turn) * float(np.abs(unit[2]).max() / np.abs(run.yaw_acceleration).max()))


def _between(run: Trajectory, back: Leg | None, turn: float, time: Array, gravity: float) -> dict[str, Array]:
    """Sample what lies between two runs, at times since the end of the first."""
    motion = np.zeros((7, len(time), 3))
    motion[0] = run.position[-1]
    if back is not None:
        motion = evaluate_legs((back,), time)
    heading = np.zeros((3, len(time)))
    if turn:
        taken = max(_turning_time(run, turn), 0.0 if back is None else back.duration)
        heading = stretched_heading(time, -turn, _TURN, taken)
    heading[0] += run.yaw[-1]
    return along(time, motion, heading, gravity)


def _all_legs(run: Trajectory, back: Leg | None, begins: list[float]) -> tuple[Leg, ...]:
    """List the moves of all runs and the ways back between them, in the order of time."""
    home = float(run.time[-1])
    legs = [
        replace(leg, begin=begin + leg.begin)
        for begin in begins
        for leg in (*run.legs, *(() if back is None else (replace(back, begin=home),)))
    ]
    return tuple(legs if back is None else legs[:-1])
