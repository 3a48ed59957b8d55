"""Rotors that are logged ten times a second, as by default: no time shift of theirs is named, and what is slow is."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.signals import as_slow_as_rotors
from cpfls_cli.flightlog.bandwidth import between_updates
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.flight import playback_flight
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.loop import loop_bounds
from cpfls_cli.playback.model import VehicleModel
from tests.builders.gap_flights import candidate, fly
from tests.builders.gusty_flights import CALM, SMALL, Flight, gusty_flights, logged

ROWS = 10  # From one update to the next, at 100 rows a second.


def rarely(signals, first):
    """The flight as a log has it whose rows repeat the rotors between updates, and as it is read."""
    held = signals.rotor_speed[np.maximum((np.arange(len(signals)) - first) // ROWS * ROWS + first, 0)]
    as_logged = replace(signals, rotor_speed=held)
    return as_logged, replace(as_logged, rotor_speed=between_updates(held, ROWS), rotor_span_s=ROWS * signals.period)


def diagnosed(flights):
    return diagnose(flights[:2], flights[2:], GapSettings(shifts=39), np.random.default_rng(1)).diagnosis


def flights_with(*effects):
    return [rarely(fly(seed, effects, gyro=2e-3, rotor=0.5), first) for seed, first in ((1, 3), (2, 7), (3, 0))]


@pytest.mark.decides
def test_updates_that_rows_repeat_are_no_time_shift_of_the_rotors():
    as_logged, read = zip(*flights_with(), strict=True)
    # They come 45 ms late on average, which a shift of the clocks explains.
    assert [effect.name for effect in diagnosed(as_logged).effects] == ["channel_delay"]
    found = diagnosed(read)
    assert (found.verdict, found.effects) == ("NO_GAP", ())


@pytest.mark.decides
def test_what_is_slow_is_named_with_its_number():
    found = diagnosed([read for _, read in flights_with((candidate("flapping_moment"), [-6e-5]))])
    (effect,) = found.effects
    (number,) = effect.numbers
    assert (found.verdict, effect.name) == ("NAMED", "flapping_moment")
    assert number.low < -6e-5 < number.high
    assert number.value == pytest.approx(-6e-5, rel=0.03)


@pytest.fixture(scope="module")
def calm():
    """Flights in closed loop in still air: as logged, with rotors on lines, and with motion averaged alike."""
    flown = gusty_flights([Flight(SMALL, CALM, path, reach=3.0) for path in (0, 1)])
    parts = [logged(each, SMALL.vehicle).parts[0] for each in flown]
    found = [rarely(part, 3) for part in parts]
    forms = zip(*((held, lines, as_slow_as_rotors(lines)) for held, lines in found), strict=True)
    return [[playback_flight([each], "linear") for each in form] for form in forms]


def test_torque_explains_rotation_that_is_averaged_as_it_is(calm):
    model = VehicleModel(vehicle=SMALL.vehicle)
    held, lines, averaged = (loop_bounds(model, each).explained[:2] for each in calm)
    assert (held < lines).all()
    assert (lines < averaged).all()


def test_the_past_shows_no_body_by_rotors_that_are_logged_rarely(calm):
    *_, averaged = calm
    vehicle = replace(SMALL.vehicle, unknown=("inertia",))
    assert find_constants(vehicle, averaged, instruments(averaged), past=True) is None
