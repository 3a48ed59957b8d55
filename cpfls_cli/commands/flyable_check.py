"""Check a plan against its vehicle, between its samples too, and say what to change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import numpy as np

from cpfls_cli.config.study import Study
from cpfls_cli.errors import SettingError
from cpfls_cli.pages.flyable_words import flyability_sentences
from cpfls_cli.simulation.inverse import Flyability, flyability, single_axis_torque
from cpfls_cli.trajectory import PlannedRotation, Trajectory, TrajectorySettings, plan

PlanAt = Callable[[float], PlannedRotation]
"""Samples a plan with a sample time in s."""

# Samples in the shortest part of a move, and how many in all are looked at.
_IN_A_PART = 8
_MOST = 1_000_000


@dataclass(frozen=True)
class Checked:
    """What a plan asks of its vehicle.

    Attributes
    ----------
    problems : tuple of str
        What is asked for beyond what the vehicle has.
    """

    found: Flyability
    problems: tuple[str, ...]


def checked_plan(study: Study, settings: TrajectorySettings, planned: PlannedRotation, at: PlanAt) -> Checked:
    """Check a plan, sampled anew where a part of a move may lie between two samples.

    Parameters
    ----------
    at : callable
        Samples the same plan with another sample time.

    Raises
    ------
    SettingError
        If the moves are too short to be looked at between the samples.
    """
    shortest = _shortest_part(planned, settings)
    step = shortest / _IN_A_PART
    if step < settings.sample_time_s:
        if planned.duration > _MOST * step:
            message = f"moves have parts of {shortest:.3g} s, too short to be checked between samples; lower it"
            raise SettingError("sample_time_s", f"{message}, or plan longer moves")
        planned = at(step)
    signals = {name: value for name, value in vars(planned).items() if isinstance(value, np.ndarray)}
    found = flyability(signals, study.vehicle, settings.tilt_max_rad)
    return Checked(found, flyability_sentences(found, planned))


def _shortest_part(planned: PlannedRotation, settings: TrajectorySettings) -> float:
    """Shortest wave or hold of any move, or half a period of the fastest harmonic."""
    if not isinstance(planned, Trajectory):
        return 0.5 / settings.rotation.frequency_max_hz
    profiles = [profile for leg in planned.legs for profile in leg.profiles]
    parts = (part for profile in profiles for part in (profile.period, *astuple(profile.holds)))
    return min(float(part) for part in parts if part > 0)


def remedy(study: Study, settings: TrajectorySettings) -> str:
    """Say what to change about a plan that asks for too much, of what the config holds."""
    if settings.held:
        alone = " ".join(f"{torque:.3g}" for torque in single_axis_torque(study.vehicle))
        return f"set trajectory.rotation.torque_max_n_m (about one axis at a time the rotors give up to {alone} N m)"
    if _turns(settings) and not _still_too_much(study, _without_turn(settings)):
        by_points = any(point.yaw_rad is not None for point in settings.waypoints)
        key = "waypoints: their yaw_rad" if by_points else f"yaw_turn_rad = {settings.yaw_turn:.4g}"
        return f"it is the turn in yaw: lower trajectory.{key}, or take longer over it"
    slower = "lower trajectory.limits" if settings.limits.given else "raise trajectory.period_s"
    return slower if settings.tilt_max_rad is None else f"{slower}, raise trajectory.tilt_max_rad"


def _turns(settings: TrajectorySettings) -> bool:
    return bool(settings.yaw_turn) or any(point.yaw_rad for point in settings.waypoints)


def _without_turn(settings: TrajectorySettings) -> TrajectorySettings:
    points = tuple(replace(point, yaw_rad=None) for point in settings.waypoints)
    return replace(settings, yaw_turn_rad=0.0, waypoints=points)


def _still_too_much(study: Study, settings: TrajectorySettings) -> bool:
    def at(sample_time: float) -> Trajectory:
        return plan(replace(settings, sample_time_s=sample_time), study.vehicle.gravity_m_s2)

    return bool(checked_plan(study, settings, at(settings.sample_time_s), at).problems)
