"""Flights of a vehicle of six kilograms that turn as sums of sines, with the rotor speeds that inverse dynamics ask."""

from dataclasses import replace

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import Candidate, weak_flight
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import windows

PERIOD = 0.01
# Rotors of four times the drag: those of the paper can hardly turn the vehicle in yaw.
VEHICLE = VehicleSettings(
    inertia_kg_m2=(0.6, 0.7, 1.2),
    rotors=tuple(
        replace(rotor, position_m=(*rotor.position_m[:2], 0.05), radius_m=0.2, drag_factor_n_m_s2=10.8e-6)
        for rotor in VehicleSettings().rotors
    ),
)
INERTIA = np.diag([0.6, 0.7, 1.2])
THROUGH = windows(PERIOD, 0.4, 0.5)


def sines(time, size, lowest_hz, highest_hz, rng, number=6):
    """A sum of sines for each channel with its first two derivatives, all by formula."""
    turn = 2 * np.pi * rng.uniform(lowest_hz, highest_hz, (number, len(size)))
    angle = time[:, None, None] * turn + rng.uniform(0, 2 * np.pi, turn.shape)
    size = np.asarray(size) * np.sqrt(2 / number)
    parts = (np.sin(angle), turn * np.cos(angle), -(turn**2) * np.sin(angle))
    return tuple((size * part).sum(axis=1) for part in parts)


def candidate(name, **shape):
    return Candidate(CATALOGUE[name], shape)


def effect_wrench(signals, effects):
    """Torque and force of effects given as (candidate, coefficients); momentum is differentiated."""
    total = np.zeros((len(signals), 6))
    for chosen, coefficients in effects:
        columns = chosen.effect.columns(signals, chosen.shape)
        total += columns.direct @ np.asarray(coefficients)
        if columns.momentum is not None:
            momentum = columns.momentum @ np.asarray(coefficients)
            total += np.gradient(momentum, signals.time, axis=0, edge_order=2)
    return total


def motion(rng, seconds=24.0, tilt=0.15, yaw=0.2, speed=3.0):
    time = PERIOD * np.arange(round(seconds / PERIOD))
    attitude, rate, second = sines(time, [tilt, tilt, yaw], [0.2, 0.2, 0.05], [0.8, 0.8, 0.25], rng)
    velocity = sines(time, [speed, speed, 1.5], 0.1, 0.4, rng)[0]
    turning = rotations.body_acceleration(attitude, rate, second)
    thrust = VEHICLE.mass_kg * 9.81 * (1 + sines(time, [0.15], 0.2, 0.6, rng)[0][:, 0])
    signals = Signals(
        time=time,
        vehicle=VEHICLE,
        attitude=attitude,
        body_rate=rotations.body_rate(attitude, rate),
        velocity=velocity,
        position=np.cumsum(velocity, axis=0) * PERIOD + [0.0, 0.0, 30.0],
    )
    return signals, turning, thrust


def fly(seed, effects=(), *, gyro=0.0, rotor=0.0, **given):
    """A flight whose rotors give what the body needs less what the effects give, with white noise on the sensors."""
    rng = np.random.default_rng(seed)
    signals, turning, thrust = motion(rng, **given)
    needed = turning @ INERTIA + np.cross(signals.body_rate, signals.body_rate @ INERTIA)
    wrench = np.zeros((len(signals), 6))
    # Effects depend on the rotor speeds and these on the effects.
    for _ in range(6 if effects else 1):
        speed = rotor_demand(VEHICLE, thrust, needed - wrench[:, :3]).speed
        signals = signals.with_rotor_speed(speed)
        wrench = effect_wrench(signals, effects)
    assert np.isfinite(speed).all()
    return replace(
        signals,
        specific_force=(wrench[:, 3:] + thrust[:, None] * [0.0, 0.0, 1.0]) / VEHICLE.mass_kg,
        body_rate=signals.body_rate + gyro * rng.standard_normal(signals.body_rate.shape),
        rotor_speed=speed + rotor * rng.standard_normal(speed.shape),
    )


def weak(signals, *, force=False, model=None, through=THROUGH):
    return weak_flight(signals, through, model, force)
