"""Whole vehicles with every part that a model can have, and the artifact of one."""

from dataclasses import replace
from functools import cache

import numpy as np

import cpfls_cli
from cpfls_cli.artifacts.model import VehicleGroup
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.vehicle_model import (
    FoundNumbersGroup,
    LoopGroup,
    SharesGroup,
    StructuresTriedGroup,
    TradesGroup,
    VehicleRecord,
)
from cpfls_cli.effects.polynomial import Probe, polynomial
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.table import Remainder
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

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
    rotors=tuple(
        RotorSettings(
            position_m=(0.3 * np.cos(k * np.pi / 3), 0.3 * np.sin(k * np.pi / 3), 0.0),
            spin=1 - 2 * (k % 2),
            thrust_factor_n_s2=8e-6,
            drag_factor_n_m_s2=1.2e-7,
        )
        for k in range(6)
    ),
)
RESPONSE = RotorResponse(delay_s=0.013, lag_s=0.035, slow_roll_pitch=-0.4, slow_yaw=0.3, slow_s=0.45)
SEVEN_RULES = (0.0, 0.1, 0.25, 0.4, 0.6, 0.7, 0.9, 1.0)


@cache
def polynomial_effects(vehicle):
    """Every effect of the catalogue that is a polynomial, with coefficients inside its range and of its size."""
    rng, probe, found = np.random.default_rng(3), Probe.of(vehicle), []
    for known in CATALOGUE.values():
        shape = {one.name: one.grid[len(one.grid) // 2] for one in known.shapes}
        if known.carried is None and polynomial(known, probe, shape) is not None:
            bounds = np.array([one.bounds(vehicle) for one in known.coefficients])
            count = polynomial(known, probe, shape).shape[0]
            lowest = np.abs(bounds).max(axis=1).min()
            sizes = np.abs(bounds).max(axis=1) if len(bounds) == count else np.full(count, lowest)
            found.append(ModelEffect(known.name, shape, 0.02 * sizes * rng.uniform(0.5, 1, count)))
    return tuple(found)


def remainder(order, breakpoints=SEVEN_RULES, rows=(0, 2, 5), size=1e-7):
    """A remainder with coefficients at random; an order of 0 makes it a seesaw."""
    features = 1 + (2 * order if order else 1)
    columns = max(len(breakpoints) - 1, 1) * features
    coefficients = size * np.random.default_rng(order).uniform(-1, 1, (len(rows), columns, 2)) * [1.0, 100.0]
    return Remainder(
        breakpoints=np.array(breakpoints), harmonic_order=order, rows=np.array(rows), coefficients=coefficients
    )


def whole(vehicle=QUAD, *, order=2, **changed):
    """A model that has every part."""
    model = VehicleModel(
        vehicle=vehicle,
        response=RESPONSE,
        thrust_linear=0.15,
        effects=polynomial_effects(vehicle),
        remainder=remainder(order),
    )
    return replace(model, **changed)


def record_of(model, config="seed: 1\n"):
    """The artifact of a vehicle, as if it had been found by a search over two structures."""
    none, text = np.zeros(0), ()
    names = ("chosen", "best", "greedy", "everything", "nothing", "front", "front")
    worse = np.array([0.0, 0.0, 0.0, 0.1, 0.4, 0.0, 0.4])
    return VehicleRecord(
        header=Header(cpfls_cli.__version__, 1, config),
        vehicle=VehicleGroup.of(model),
        found=FoundNumbersGroup(
            name=("inertia.Ixx", "linear_damping.d_x"),
            unit=("kg m^2", "N m s/rad"),
            value=np.array([0.02, 1e-3]),
            low=np.array([0.018, 0.0]),
            high=np.array([0.022, 2e-3]),
            stated=np.array([0.004, np.nan]),
            determined=np.array([True, False]),
            at_bound=np.array([False, True]),
        ),
        trade=TradesGroup(first=text, second=text, correlation=none),
        structure=StructuresTriedGroup(
            name=names,
            blocks=tuple("" if name == "nothing" else "inertia linear_damping" for name in names),
            error=0.5 + worse,
            worse=worse,
            uncertain=np.full(len(names), 0.01),
            numbers=np.array([4, 4, 4, 9, 0, 4, 0], dtype=np.int64),
            condition_number=np.full(len(names), 30.0),
        ),
        loop=LoopGroup(low=0.99 * np.ones(3), high=1.01 * np.ones(3), explained=0.98 * np.ones(3), shown=False),
        share=SharesGroup(name=("rotors",), torque=np.ones((1, 3)), force=np.ones((1, 3))),
        airspeed=4.0,
        evaluated=2,
        complete=True,
        blocks=30,
        warning=text,
    )


def accelerations(model, state, rotor):
    """``v' = g + R F / m`` and ``omega' = I^-1 (M - omega x I omega)`` of a constant inertia, shape (samples, 6)."""
    body = model.body
    air = np.einsum("nji,nj->ni", state.rotation, state.velocity - model.wind)
    wrench = model.table.wrench(air, state.rate, rotor)
    linear = np.einsum("nij,nj->ni", state.rotation, wrench[:, 3:]) / body.mass - [0.0, 0.0, body.gravity]
    return np.hstack([linear, (wrench[:, :3] - np.cross(state.rate, state.rate @ body.inertia)) @ body.inverse])
