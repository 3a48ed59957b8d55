"""What a planned path asks of its vehicle beyond what it has, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.pages.flown import samples, violation_sentence
from cpfls_cli.simulation.inverse import Flyability, TooMuch
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory


def flyability_sentences(found: Flyability, planned: PlannedRotation) -> tuple[str, ...]:
    """Say what is too much, with its time and place.

    Returns
    -------
    tuple of str
        Empty where the vehicle can do it all.
    """
    return tuple(_sentences(found, planned))


def _sentences(found: Flyability, planned: PlannedRotation) -> Iterator[str]:
    for too_much in found.too_much:
        yield _too_much(too_much, planned)
    for violation in found.rotors:
        yield violation_sentence(violation, planned.time) + _place(violation.first, planned)


def _too_much(found: TooMuch, planned: PlannedRotation) -> str:
    name, unit = found.what.split(", ")
    worst = f"{found.worst:.4g} {unit} at {planned.time[found.at]:.2f} s{_place(found.at, planned)}"
    start = f"from {planned.time[found.first]:.2f} s, {samples(found.count)}"
    return f"{name} of up to {worst} asked for; the limit is {found.limit:.4g} {unit} (beyond it {start})"


def _place(sample: int, planned: PlannedRotation) -> str:
    if isinstance(planned, Trajectory):
        return f", at x y z = {_written(planned.position[sample])} m"
    return f", at roll pitch yaw = {_written(np.degrees(planned.attitude[sample]) % 360)} deg"


def _written(values: Array) -> str:
    return " ".join(f"{value:.2f}" for value in values)
