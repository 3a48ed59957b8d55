"""A plan as the datasets of its artifact, and what there is to say of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.formats import TRAJECTORY
from cpfls_cli.commands.flyable_check import Checked
from cpfls_cli.excitation.optimise import Excitation
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.simulation.inverse import Flyability
from cpfls_cli.trajectory.legs import Leg
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory

_UNITS = ("m", "m/s", "m/s^2", "m/s^3", "m/s^4", "m/s^5", "m/s^6")
_LEGS_SHOWN = 12


def trajectory_data(planned: PlannedRotation) -> dict[str, Any]:
    """Arrange a plan as datasets."""
    values = vars(planned)
    data = {spec.path: values[spec.path] for spec in TRAJECTORY.datasets if spec.path in values}
    if not isinstance(planned, Trajectory):
        return data
    return data | {
        "leg/begin": np.array([leg.begin for leg in planned.legs]),
        "leg/end": np.array([leg.end for leg in planned.legs]),
        "leg/displacement": np.array([leg.vector for leg in planned.legs]),
        "leg/limited_by": np.array([" ".join(leg.limited_by) for leg in planned.legs], dtype=str),
    }


def trajectory_outcome(planned: PlannedRotation, checked: Checked, figures: tuple[Path, ...]) -> Outcome:
    """Describe a plan.

    Parameters
    ----------
    checked : Checked
        What it asks of the vehicle.
    figures : tuple of Path
        Pictures that were drawn.
    """
    found, problems = checked.found, checked.problems
    common: dict[str, Any] = {
        "figures": [str(path) for path in figures],
        "samples": len(planned.time),
        "duration_s": planned.duration,
        "dt_s": float(planned.time[1]),
        "max_rate_rad_s": _largest(planned.attitude_rate),
        "max_body_rate_rad_s": _largest(planned.body_rate),
        "max_acceleration_rad_s2": _largest(planned.attitude_acceleration),
        "max_thrust_n": float(found.thrust.max()),
    }
    first = f"{len(planned.time)} samples over {planned.duration:g} s"
    drawn = [f"drawn: {', '.join(map(str, figures))}"] if figures else []
    if isinstance(planned, Trajectory):
        common["max_tilt_rad"] = float(found.tilt.max())
        return Outcome(common | _moved(planned), (first, *_path_lines(planned, found), *drawn), problems)
    return Outcome(common, (first, *_held_lines(common), *drawn), problems)


def with_excitation(outcome: Outcome, found: Excitation | None) -> Outcome:
    """Add what an optimised path is worth, beside random ones.

    Parameters
    ----------
    found : Excitation or None
        None leaves the outcome as it is.
    """
    if found is None:
        return outcome
    random = {"best": float(found.random.min()), "median": float(np.median(found.random))}
    summary = {"condition_number": found.condition_number, "random": random, "evaluations": found.evaluations}
    line = (
        f"condition number of the model's regressor {found.condition_number:.4g}, uniform partitions; of "
        f"{len(found.random)} random paths the best had {random['best']:.4g}, the median {random['median']:.4g}"
    )
    return replace(outcome, summary={**outcome.summary, **summary}, blocks=(*outcome.blocks, line))


def _largest(values: Any) -> list[float]:
    return [float(value) for value in np.abs(values).max(axis=0)]


def _moved(planned: Trajectory) -> dict[str, Any]:
    legs = [
        {
            "begin_s": leg.begin,
            "duration_s": leg.duration,
            "displacement_m": leg.vector.tolist(),
            "limited_by": list(leg.limited_by),
            "jerk_integral_m_s2": _jerk(leg),
        }
        for leg in planned.legs
    ]
    return {"max": {**planned.maxima, "position": planned.maxima["displacement"]}, "legs": legs}


def _path_lines(planned: Trajectory, found: Flyability) -> list[str]:
    names = zip(planned.maxima.items(), _UNITS, strict=True)
    peaks = ", ".join(_peak(name, value, unit) for (name, value), unit in names)
    tilt, thrust = np.degrees(found.tilt.max()), found.thrust.max()
    lines = [f"largest {peaks}", f"largest tilt {tilt:.3g} deg, largest thrust {thrust:.4g} N"]
    if not any(leg.limited_by for leg in planned.legs):
        return lines
    shown = planned.legs[:_LEGS_SHOWN]
    lines += [f"leg {number}: {_leg(leg)}" for number, leg in enumerate(shown, start=1)]
    hidden = len(planned.legs) - len(shown)
    return [*lines, f"and {hidden} more legs; --json lists all"] if hidden else lines


def _peak(name: str, value: float, unit: str) -> str:
    return f"{name} {value:.6g} {unit}" if np.isfinite(value) else f"{name} without bound (nothing limits it)"


def _leg(leg: Leg) -> str:
    length = float(np.linalg.norm(leg.vector))
    limited = ", ".join(leg.limited_by)
    return f"{length:.6g} m in {leg.duration:.6g} s, limited by {limited}; integral of |jerk| {_jerk(leg):.4g} m/s^2"


def _jerk(leg: Leg) -> float:
    """Integrate the absolute jerk of the axis that has most of it."""
    return max(profile.integral_of_absolute_jerk for profile in leg.profiles)


def _held_lines(common: Mapping[str, Any]) -> list[str]:
    def written(key: str) -> str:
        return " ".join(f"{value:.4g}" for value in common[key])

    return [
        "held at its centre of mass; largest, roll pitch yaw:",
        f"Euler rates {written('max_rate_rad_s')} rad/s, body rates {written('max_body_rate_rad_s')} rad/s, "
        f"Euler accelerations {written('max_acceleration_rad_s2')} rad/s^2",
    ]
