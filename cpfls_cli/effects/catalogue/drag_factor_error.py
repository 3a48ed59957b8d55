"""Wrong drag (yaw) factor of the rotors, the least known number of most vehicles."""

from collections.abc import Mapping
from dataclasses import replace

from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.rotors import with_factors
from cpfls_cli.vehicle.settings import VehicleSettings


def _vehicle(vehicle: VehicleSettings, shape: Mapping[str, float]) -> VehicleSettings:
    return with_factors(vehicle, 1.0, 1.0 + shape["error"])


def _accounts(number: str, values: Mapping[str, float], _vehicle: VehicleSettings) -> float:
    """Account for as much of Izz: yaw knows well only the ratio of the two."""
    return abs(values["error"]) if number == "inertia_z" else 0.0


def _acts(see: Instant, p: Numbers) -> Wrench:
    return Wrench((0, 0, -p["error"] * see.functions.total(see.spins * see.rotor_drag)))


EFFECT = Effect(
    name="drag_factor_error",
    order=290,
    title="wrong drag (yaw) factor",
    quantity="scales",
    kind="actuator",
    formula="M_z = -e b sum(s_i w_i^2)",
    sentence="The rotors turn the vehicle in yaw with a torque other than the config says. It shows with an effect "
    "that also pushes the vehicle, because the force identifies its torque; yaw alone shows only the ratio of "
    "the drag factor to Izz.",
    needs=frozenset({"body_rate", "rotor_speed"}),
    excitation="turns in yaw while flying fast; or weigh and swing the vehicle, so that Izz is known",
    rivals={"linear_damping": "yaw at several rates in hover: a damping stays, a wrong factor needs air speed"},
    source="definition; the drag factor is the number that data sheets lack",
    shapes=(Shape("error", "1", (-0.6, -0.4, -0.2, -0.1, 0.1, 0.2, 0.4, 0.8, 1.5), "true factor over stated, less 1"),),
    apply=lambda signals, shape: replace(signals, vehicle=_vehicle(signals.vehicle, shape)),
    in_vehicle=lambda parts, shape, _: parts._replace(vehicle=_vehicle(parts.vehicle, shape)),
    accounts=_accounts,
    acts=_acts,
)
