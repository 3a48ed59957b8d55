"""The vehicle of a study: rotors of a simulator's file in the order of the log, and which way they turn."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.flightlog.airframe import Airframe, RotorPlace
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.study import of_log
from tests.builders.gusty_flights import LARGE
from tests.builders.simulator_files import sdf_of

ARM = 0.12
X = [(ARM, -ARM), (-ARM, -ARM), (-ARM, ARM), (ARM, ARM)]


class Coaxial(type(LARGE)):
    """Eight rotors, two on each arm."""

    places = np.repeat(X, 2, axis=0)


def of(folder, spins, logged, sure="stated", truth=LARGE):
    """Make the vehicle of a file, and of a log whose rotors are (x, y, spin)."""
    path = folder / "mine.sdf"
    path.write_text(sdf_of(truth, spins=spins))
    rotors = tuple(RotorPlace("", (x, y), spin) for x, y, spin in logged)
    airframe = Airframe(rotors, True, "parameters", sure)
    proposal = SimpleNamespace(airframe=airframe, rotors=len(rotors), speed_max=900.0, share_of_speed=False)
    return of_log(read_model(path), proposal, None)


def test_rotors_on_one_arm_are_distinguished_by_their_spin(tmp_path):
    logged = [(*place, spin) for spin in (1, -1) for place in X]
    vehicle = of(tmp_path, (-1, 1) * 4, logged, truth=Coaxial(*LARGE))
    assert vehicle.order == (1, 3, 5, 7, 0, 2, 4, 6)
    assert (vehicle.warnings, vehicle.turned) == ((), ())


def test_rotors_that_nothing_separates_are_said(tmp_path):
    logged = [(*place, 1) for place in X for _ in range(2)]
    vehicle = of(tmp_path, (1,) * 8, logged, truth=Coaxial(*LARGE))
    assert (
        "M1 and M2 lie in the same direction and turn the same way, so which is which is a guess" in vehicle.warnings[0]
    )


def test_places_that_do_not_fit_leave_the_order_of_the_file(tmp_path):
    crowded = [(1.0, -1.0, -1), (1.0, -1.1, 1), (1.0, -0.9, -1), (-1.0, 1.0, 1)]
    vehicle = of(tmp_path, (-1, 1, -1, 1), crowded)
    assert vehicle.order == (0, 1, 2, 3)
    assert "no order of its rotors fits that of the log" in vehicle.warnings[0]


@pytest.mark.parametrize(
    ("turned", "sure", "has_log"),
    [([3], "data", True), ([0, 1], "data", True), ([0, 1, 2, 3], "data", False), ([0, 1, 2, 3], "stated", True)],
)
def test_single_rotors_turn_as_the_log_has_them(tmp_path, turned, sure, has_log):
    """Where the motion has all of them turn the other way, the axes of the log may be mirrored."""
    true = [-1, 1, -1, 1]
    spins = [-spin if index in turned else spin for index, spin in enumerate(true)]
    vehicle = of(tmp_path, spins, [(*place, spin) for place, spin in zip(X, true, strict=True)], sure)
    assert list(vehicle.spins) == (true if has_log else spins)
    assert list(vehicle.turned) == (turned if has_log else [])
    assert len(vehicle.warnings) == len(turned)


def test_a_largest_speed_that_a_log_let_one_guess_is_that_of_the_model(tmp_path):
    """Whose config was made with another log: what is guessed makes no other vehicle."""
    path = tmp_path / "mine.sdf"
    path.write_text(sdf_of(LARGE, spins=(-1, 1, -1, 1)))
    model = read_model(path)
    fast = 1.3 * model.speed_max.value
    proposal = SimpleNamespace(airframe=None, rotors=4, speed_max=fast, share_of_speed=False)
    like = replace(LARGE.vehicle, rotor_speed_max_rad_s=1.5 * model.speed_max.value)
    assert of_log(model, proposal, None).speed_max == fast
    assert of_log(model, proposal, None, like).speed_max == like.rotor_speed_max_rad_s
