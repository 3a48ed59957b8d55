"""What acts on a vehicle at an instant."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.vehicle.motion import Acting, Instant, Vehicle
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import ARRAYS

REACTION = CATALOGUE["rotor_acceleration"]


@pytest.mark.parametrize(
    "spins", sorted(product((-1, 1), repeat=4)), ids=lambda spins: "".join("-.+"[s + 1] for s in spins)
)
def test_the_reaction_to_rotors_that_speed_up_needs_no_order_of_spins(spins):
    stated = VehicleSettings()
    rotors = tuple(replace(rotor, spin=spin) for rotor, spin in zip(stated.rotors, spins, strict=True))
    vehicle = Vehicle(replace(stated, rotors=rotors), (Acting("reaction", REACTION.acts, {"J_r": 2e-5}),))
    speeding = np.array([[10.0], [-30.0], [70.0], [150.0]])
    seen = Instant(vehicle.settings, np.full((4, 1), 500.0), rotor_acceleration=speeding, functions=ARRAYS)
    torque, _ = vehicle.wrench(seen)
    assert torque[2] == pytest.approx(-2e-5 * (np.array(spins)[:, None] * speeding).sum(axis=0))
