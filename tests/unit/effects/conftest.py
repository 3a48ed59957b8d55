"""A smooth flight of which everything is known, and columns as people read them."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.vehicles import alike

SIX_KILOGRAMS = VehicleSettings(
    rotors=tuple(
        replace(rotor, position_m=(*rotor.position_m[:2], 0.05), radius_m=0.2) for rotor in VehicleSettings().rotors
    )
)
CRAZYFLIE = VehicleSettings(
    mass_kg=0.03,
    inertia_kg_m2=(1.43e-5, 1.43e-5, 2.89e-5),
    rotors=alike(((1, -1, 1), (-1, -1, -1), (-1, 1, 1), (1, 1, -1)), 2.3e-8, 7.8e-10, 0.0304),
)
VEHICLES = {"6 kg": SIX_KILOGRAMS, "Crazyflie": CRAZYFLIE}


def waves(time, channels, amplitude, offset=0.0):
    phases = np.arange(channels)
    return offset + amplitude * np.sin(np.outer(time, 2.0 + 1.3 * phases) + phases)


def make_flight(**changes):
    time = np.arange(600) * 0.005
    known = {
        "time": time,
        "vehicle": SIX_KILOGRAMS,
        "attitude": waves(time, 3, 0.3),
        "body_rate": waves(time + 0.4, 3, 0.8),
        "velocity": waves(time, 3, 4.0, -1.0),
        "position": waves(time, 3, 0.2, 0.6),
        "rotor_speed": waves(time, 4, 40.0, 348.0),
        "voltage": np.linspace(1.0, 0.8, len(time)),
    }
    return Signals(**{**known, **changes})


@pytest.fixture
def flight():
    return make_flight()


@pytest.fixture
def commanded():
    return make_flight(commanded=True)


@pytest.fixture
def columns():
    def of(name, signals, **shape):
        return CATALOGUE[name].columns(signals, shape)

    return of


@pytest.fixture
def vehicles():
    return VEHICLES


@pytest.fixture(params=list(VEHICLES))
def vehicle(request):
    return VEHICLES[request.param]


@pytest.fixture
def with_velocity():
    return lambda signals, velocity: replace(signals, velocity=np.broadcast_to(velocity, signals.velocity.shape))
