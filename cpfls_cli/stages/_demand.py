"""What a plan asks for beyond what the vehicle has, in words with time and place."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flights.flight import Infeasible
from cpfls_cli.simulation.inverse import Flyability, TooMuch
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory

_TURN = 360.0


def demand_sentences(demand: Flyability, planned: PlannedRotation) -> tuple[str, ...]:
    """Say what a plan asks for beyond what the vehicle has, with its time and place; nothing where it can do it all."""
    return (
        *(_too_much(too_much, planned) for too_much in demand.too_much),
        *(infeasible_sentence(Infeasible.of(one, planned.time)) + _place(one.first, planned) for one in demand.rotors),
    )


def infeasible_sentence(one: Infeasible) -> str:
    """Say what a rotor was asked for that it cannot do."""
    return (
        f"M{one.rotor}: {one.kind} asked for at {_samples(one.samples)} from {one.first_s:.2f} s to "
        f"{one.last_s:.2f} s (worst squared speed {one.worst:.6g} rad^2/s^2)"
    )


def _too_much(too_much: TooMuch, planned: PlannedRotation) -> str:
    name, unit = too_much.what.split(", ")
    worst = f"{too_much.worst:.4g} {unit} at {planned.time[too_much.at]:.2f} s{_place(too_much.at, planned)}"
    start = f"from {planned.time[too_much.first]:.2f} s, {_samples(too_much.count)}"
    return f"{name} of up to {worst} asked for; the limit is {too_much.limit:.4g} {unit} (beyond it {start})"


def _samples(count: int) -> str:
    return f"{count} sample{'' if count == 1 else 's'}"


def _place(sample: int, planned: PlannedRotation) -> str:
    if isinstance(planned, Trajectory):
        return f", at x y z = {_written(planned.position[sample])} m"
    return f", at roll pitch yaw = {_written(np.degrees(planned.attitude[sample]) % _TURN)} deg"


def _written(values: Array) -> str:
    return " ".join(f"{value:.2f}" for value in values)
