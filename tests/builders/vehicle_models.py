"""Whole vehicles with every part that a model can have, and the artifact of one."""

from dataclasses import replace
from functools import cache

import numpy as np

from cpfls_cli import store
from cpfls_cli.artifacts.gate import Origin
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.export.numbers import weights_of
from cpfls_cli.playback.errors import AlongFlights, Errors, Prediction
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.playback.model import ModelEffect, Remainder, VehicleModel
from cpfls_cli.playback.parameters import FoundNumber
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.structure import TriedStructure
from cpfls_cli.playback.vehicle import Share
from cpfls_cli.report.source import source_of_result
from cpfls_cli.vehicle.motion import Acting
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.vehicles import alike

QUAD = VehicleSettings(
    mass_kg=0.9,
    inertia_kg_m2=(4e-3, 4.4e-3, 7e-3, 1e-4, -2e-4, 5e-5),
    rotors=tuple(
        RotorSettings(
            position_m=(0.11 * x, 0.12 * y, 0.02),
            spin=x * y,
            thrust_factor_n_s2=2e-6 * (1 + 0.02 * x),
            drag_factor_n_m_s2=3e-8,
            radius_m=0.06 if x > 0 else None,
        )
        for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1))
    ),
    rotor_speed_max_rad_s=2500.0,
)
HEXA = VehicleSettings(
    mass_kg=2.0,
    inertia_kg_m2=(0.02, 0.021, 0.04),
    rotors=alike(
        [(np.cos(k * np.pi / 3), np.sin(k * np.pi / 3), 1 - 2 * (k % 2)) for k in range(6)], 8e-6, 1.2e-7, arm=0.3
    ),
)
RESPONSE = RotorResponse(delay_s=0.013, lag_s=0.035, slow_roll_pitch=-0.4, slow_yaw=0.3, slow_s=0.45)
SEVEN_RULES = (0.0, 0.1, 0.25, 0.4, 0.6, 0.7, 0.9, 1.0)
ORIGIN = Origin(stage="vehicle", seed=1, config="seed: 1\n")


@cache
def polynomial_effects(vehicle):
    """Every effect of the catalogue that is a polynomial, with coefficients inside its range and of its size."""
    rng, found = np.random.default_rng(3), []
    for known in CATALOGUE.values():
        if known.kind == "wrench" and known.acts is not None and is_held(known, vehicle):
            sizes = np.abs([one.bounds(vehicle) for one in known.coefficients]).max(axis=1)
            numbers = {one.name: size for one, size in zip(known.coefficients, sizes, strict=True)}
            if weights_of([Acting(known.name, known.acts, numbers)], vehicle):
                found.append(ModelEffect(known.name, {}, 0.02 * sizes * rng.uniform(0.5, 1, len(sizes))))
    return tuple(found)


def is_held(known, vehicle):
    """Say whether an effect follows from air velocity, body rate and rotors."""
    if "rotor_radius" in known.needs and any(rotor.radius_m is None for rotor in vehicle.rotors):
        return False
    shape = {one.name: one.grid[0] for one in known.shapes}
    numbers = 0.1 * np.ones(0 if known.unit_coefficient else len(known.coefficients))
    return not VehicleModel(vehicle=vehicle, effects=(ModelEffect(known.name, shape, numbers),)).unsimulated


def thrust_curve(share):
    """A thrust of which so much is linear in the command in hover."""
    return ModelEffect("thrust_slope", {}, np.array([share]))


def remainder(order, breakpoints=SEVEN_RULES, rows=(0, 2, 5), size=1e-7):
    """A remainder with coefficients at random; an order of 0 makes it a seesaw."""
    columns = max(len(breakpoints) - 1, 1) * (1 + (2 * order if order else 1))
    coefficients = size * np.random.default_rng(order).uniform(-1, 1, (len(rows), columns, 2)) * [1.0, 100.0]
    return Remainder(
        breakpoints=np.array(breakpoints), harmonic_order=order, rows=np.array(rows), coefficients=coefficients
    )


def whole(vehicle=QUAD, *, order=2, **changed):
    """A model that has every part."""
    model = VehicleModel(
        vehicle=vehicle, response=RESPONSE, effects=polynomial_effects(vehicle), remainder=remainder(order)
    )
    return replace(model, **changed)


def number_of(name, value=1.0, low=0.9, high=1.1, stated=np.nan, *, determined=True, at_bound=False, possible=True):
    """A number that was found."""
    return FoundNumber(name, "", value, low, high, stated, determined, at_bound, possible)


def vehicle_of(model, **changed):
    """A vehicle, as if it had been found by a search over two structures."""
    names = ("chosen", "best", "added", "everything", "nothing", "front", "front")
    two = ("inertia", "linear_damping")
    rows = zip(names, (0.0, 0.0, 0.0, 0.1, 0.4, 0.0, 0.4), (4, 4, 4, 9, 0, 4, 0), strict=True)
    given = {
        "model": model,
        "numbers": (
            FoundNumber("inertia.Ixx", "kg m^2", 0.02, 0.018, 0.022, 0.004, True, False),
            FoundNumber("linear_damping.d_x", "N m s/rad", 1e-3, 0.0, 2e-3, np.nan, False, True),
        ),
        "shares": (Share("rotors", np.ones(6)),),
        "airspeed_m_s": 4.0,
        "trades": (),
        "correlation": np.eye(len(changed.get("numbers", "ab"))),
        "structures": tuple(
            TriedStructure(name, () if name == "nothing" else two, 0.5 + worse, worse, 0.01, numbers, 30.0)
            for name, worse, numbers in rows
        ),
        "evaluated": 2,
        "complete": True,
        "blocks": 30,
        "loop": LoopBounds(0.99 * np.ones(3), 1.01 * np.ones(3), 0.98 * np.ones(3)),
    }
    return Vehicle(**given | changed)


def held_out(velocity):
    """Playback over half a second that is twice as good as its rivals, but for the velocity; None for none."""
    horizon = np.linspace(0.02, 0.5, 25)

    def prediction(rate, speed):
        errors = {"body_rate": rate} | ({} if velocity is None else {"velocity": speed})
        made = {name: Errors(mae=factor * horizon, rms_by_axis=np.zeros((25, 3))) for name, factor in errors.items()}
        return Prediction(diverged=0, **made)

    factors = {"model": (1.0, velocity), "nothing-moves": (2, 2), "rate-stays": (2, 2), "stated": (9, 9)}
    models = {name: prediction(*own) for name, own in factors.items()}
    return AlongFlights(horizon_s=horizon, models=models, flights=("other.h5",), windows=9)


def write_vehicle(path, vehicle, config=ORIGIN.config, **more):
    """Write a vehicle, as its command would; give its path."""
    store.write(path, vehicle, replace(ORIGIN, config=config, **more))
    return path


def source_of_vehicle(vehicle, label="vehicle.h5"):
    """Name a vehicle, as if it had been read."""
    return source_of_result(vehicle, ORIGIN, label, label, "")


def wrench_somewhere(model, count=20):
    """Torque and force of a model at motions and rotor speeds at random."""
    rng = np.random.default_rng(0)
    motion = rng.normal(0, 2, (2, count, 3))
    return model.wrench(*motion, np.hstack([np.ones((count, 1)), rng.uniform(0, 1000, (count, 4 * model.rotors))]))


def accelerations(model, state, rotor):
    """``v' = g + R F / m`` and ``omega' = I^-1 (M - omega x I omega)`` of a constant inertia, shape (samples, 6)."""
    body = model.body
    wrench = model.wrench(np.einsum("nji,nj->ni", state.rotation, state.velocity - model.wind), state.rate, rotor)
    linear = np.einsum("nij,nj->ni", state.rotation, wrench[:, 3:]) / body.mass - [0.0, 0.0, body.gravity]
    return np.hstack([linear, (wrench[:, :3] - np.cross(state.rate, state.rate @ body.inertia)) @ body.inverse])
