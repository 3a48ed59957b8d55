"""Stage `trajectory`: plan the training path."""

from __future__ import annotations

from dataclasses import asdict

from cpfls_cli.artifacts.formats import TRAJECTORY
from cpfls_cli.stages.job import Job, Outcome, begin, finish
from cpfls_cli.trajectory.path import plan


def run(job: Job) -> Outcome:
    """Plan the path of a study and write it.

    Parameters
    ----------
    job : Job

    Returns
    -------
    Outcome
    """
    started = begin(job, {})
    if started.dry_run is not None:
        return started.dry_run
    planned = plan(job.study.trajectory, job.study.vehicle.gravity_m_s2)
    values = asdict(planned)
    finish(job, TRAJECTORY, {spec.path: values[spec.path] for spec in TRAJECTORY.datasets}, started.inputs)
    settings = job.study.trajectory
    summary = {
        "samples": len(planned.time),
        "duration_s": settings.duration_s,
        "dt_s": settings.sample_time_s,
        "max": {**planned.maxima, "position": planned.maxima["displacement"]},
    }
    units = dict(zip(planned.maxima, ("m", "m/s", "m/s^2", "m/s^3", "m/s^4", "m/s^5", "m/s^6"), strict=True))
    peaks = ", ".join(f"{name} {value:.6g} {units[name]}" for name, value in planned.maxima.items())
    return Outcome(summary, (f"{len(planned.time)} samples over {settings.duration_s:g} s", f"largest {peaks}"))
