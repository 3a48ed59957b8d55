"""Flights in closed loop that a multirotor can fly exactly, for the tests of this package."""

import pickle
from copy import deepcopy

import numpy as np

from cpfls_cli.effects.signals import Signals
from cpfls_cli.simulation.inverse import measure
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.trajectory.planning import flat_attitude
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

HUBS = (((0.3, 0.0, 0.05), 1), ((0.0, -0.3, 0.05), -1), ((-0.3, 0.0, 0.05), 1), ((0.0, 0.3, 0.05), -1))
VEHICLE = VehicleSettings(rotors=tuple(RotorSettings(position_m=hub, spin=spin, radius_m=0.2) for hub, spin in HUBS))
PERIOD = 0.01
COARSE = 200.0
"""Steps of the integration in a second, Hz, where a flight is not held against its own exact motion."""
_FLOWN = {}


def planned(duration=3.0, also=0.0):
    """Swings along all axes that a multirotor can fly exactly, 1.5 m above the ground, and faster ones of `also` m."""
    time = PERIOD * np.arange(round(duration / PERIOD) + 1)
    swings = ((np.array([0.35, 0.25, 0.2]), np.array([2.4, 2.9, 1.7])), (also, np.array([5.1, 6.1, 4.3])))
    phase = np.array([0.3, 1.0, 2.0])
    motion = [
        sum(size * speed**n * np.sin(np.outer(time, speed) + phase + n * np.pi / 2) for size, speed in swings)
        for n in range(5)
    ]
    heading = np.stack([0.15 * 1.5**n * np.sin(1.5 * time + n * np.pi / 2) for n in range(3)])
    flat = flat_attitude(time, np.stack(motion[2:]), heading, 9.81)
    path = {"position": motion[0] + [0, 0, 1.5], "velocity": motion[1], "acceleration": motion[2]}
    return time, {**path, **vars(flat)}


def flown(duration=3.0, seed=1, vehicle=VEHICLE, noise=None, relative_noise=None, also=0.0, **closed_loop):
    """Fly, or remember the flight: many tests begin with the same one."""
    settings = SimulationSettings(
        mode="closed-loop",
        noise=noise or {},
        relative_noise=relative_noise or {},
        closed_loop=ClosedLoopSettings(**closed_loop),
    )
    known = pickle.dumps((duration, seed, vehicle, settings, also))
    if known not in _FLOWN:
        time, plan = planned(duration, also)
        _FLOWN[known] = measure(time, plan, vehicle, settings, np.random.default_rng(seed))
    return deepcopy(_FLOWN[known])


def signals_of(flight):
    logged = flight.signals
    hidden = "rotor_speed" not in logged
    return Signals(
        time=PERIOD * np.arange(len(logged["attitude"])),
        vehicle=VEHICLE,
        rotor_speed=logged["rotor_command" if hidden else "rotor_speed"],
        commanded=hidden,
        voltage=logged.get("voltage"),
        **{name: logged[name] for name in ("attitude", "body_rate", "position", "velocity", "acceleration")},
    )


def by_columns(one):
    """Give the shape and the linear coefficients of a simulated effect, as a fit has them."""
    effect, values = one.effect, one.values
    physical = np.array([values[each.name] for each in effect.coefficients])
    linear = physical if effect.physical is None else effect.physical.linear(physical)
    return {each.name: values[each.name] for each in effect.shapes}, np.ones(1) if effect.unit_coefficient else linear
