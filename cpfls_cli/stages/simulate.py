"""Stage `simulate`: fly a trajectory with the exact vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import FLIGHT, TRAJECTORY
from cpfls_cli.errors import ComputationError
from cpfls_cli.simulation.simulate import SimulatedFlight, simulate
from cpfls_cli.stages.job import Job, Outcome, begin, finish
from cpfls_cli.stages.sources import read_with
from cpfls_cli.stages.study import generator
from cpfls_cli.vehicle.violations import RotorViolation

_PLANNED = ("attitude", "attitude_rate", "attitude_acceleration", "position", "velocity", "acceleration")


def run(job: Job, trajectory: Path) -> Outcome:
    """Simulate a flight along a trajectory and write it.

    Parameters
    ----------
    job : Job
    trajectory : Path

    Returns
    -------
    Outcome

    Raises
    ------
    ComputationError
        If a rotor would have to do what it cannot, unless `simulation.infeasible` is ``report``.
    """
    started = begin(job, {"trajectory": trajectory})
    source = read_with(trajectory, TRAJECTORY, "time", *_PLANNED)
    if started.dry_run is not None:
        return started.dry_run
    planned = {name: source.array(name) for name in _PLANNED}
    flight = simulate(planned, job.study.vehicle, job.study.simulation, generator(job.study, "simulate"))
    time = source.array("time")
    problems = tuple(_sentence(violation, time) for violation in flight.violations)
    if problems and job.study.simulation.infeasible == "stop":
        remedy = "fly gentler, change the vehicle, or set simulation.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{trajectory}: no flight was written; {remedy}"]))
    finish(job, FLIGHT, {"time": time, **flight.signals, **_noise(flight)}, started.inputs)
    return _outcome(flight, time, problems)


def _outcome(flight: SimulatedFlight, time: Array, problems: tuple[str, ...]) -> Outcome:
    largest = [float(value) for value in np.max(np.abs(flight.signals["torque"]), axis=0)]
    summary = {
        "samples": len(time),
        "max_torque": largest,
        "noise": sorted(flight.noise_std),
        "infeasible": [
            {"rotor": v.rotor + 1, "kind": v.kind, "first_s": float(time[v.first]), "samples": v.count}
            for v in flight.violations
        ],
    }
    line = "{} samples; largest generalised torque {:.4g} {:.4g} {:.4g} N m (roll pitch yaw)".format(
        len(time), *largest
    )
    return Outcome(summary, (line,), problems)


def _sentence(violation: RotorViolation, time: Array) -> str:
    start, end = time[violation.first], time[violation.last]
    return (
        f"rotor {violation.rotor + 1}: {violation.kind} asked for at {violation.count} samples from {start:.2f} s to "
        f"{end:.2f} s (worst squared speed {violation.worst:.6g} rad^2/s^2)"
    )


def _noise(flight: SimulatedFlight) -> dict[str, Any]:
    names = [name for name, std in flight.noise_std.items() if len(std) == 3]
    if not names:
        return {}
    return {"noise/signal": np.array(names), "noise/std": np.array([flight.noise_std[name] for name in names])}
