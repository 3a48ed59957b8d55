"""Responses of a quadrotor that is flown through gusts by dynamics of its own, next to models right and wrong."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.playback.instruments import Repeats, instruments
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.response.flown import specific_force, vehicle_responses
from tests.builders.gusty_flights import GUSTS, SMALL, Flight, gusty_flights, logged

SECONDS = 40.0
RIGHT = VehicleModel(vehicle=SMALL.vehicle)


@pytest.fixture(scope="module")
def flights():
    """The same path four times, with a gust of its own each."""
    flown = gusty_flights([Flight(SMALL, GUSTS, 0, draw, reach=10.0) for draw in range(4)], SECONDS)
    return [logged(flight, SMALL.vehicle) for flight in flown]


def by_repeats(flights):
    """Take the same path flown again."""
    found = instruments([flight.playback for flight in flights])
    assert found.kind == "repeats"
    return found.by_flight


def by_setpoints(flights):
    """Take what the path asks for; no flight is held to repeat another."""
    found = instruments([flight.playback for flight in flights])
    return replace(found, repeats=Repeats(({},) * len(flights), {})).by_flight


@pytest.mark.parametrize("source", [by_repeats, by_setpoints])
def test_the_right_model_is_good(flights, source):
    found = vehicle_responses(RIGHT, flights, source(flights))
    assert list(found)[:4] == ["roll", "pitch", "yaw", "thrust"]
    for name in ("roll", "pitch", "thrust"):
        low, high = found[name].band
        assert low < 1.0
        assert high > 10.0
        assert found[name].cost < 8.0
        assert all(each.right for each in found[name].deviations)
    # Nothing turns the vehicle about yaw but gusts, and that is said.
    assert found["roll"].instrumented
    assert not found["yaw"].instrumented


def test_without_instruments_gusts_are_taken_for_the_vehicle(flights):
    found = vehicle_responses(RIGHT, flights)
    assert found["yaw"].cost > 500.0
    assert found["thrust"].deviations[0].gain > 1.5
    assert not found["thrust"].deviations[0].right


@pytest.mark.parametrize("factor", [0.5, 1.3, 2.0])
def test_a_body_of_another_weight_is_seen(flights, factor):
    inertia = tuple(factor * value for value in SMALL.inertia)
    wrong = VehicleModel(vehicle=replace(SMALL.vehicle, inertia_kg_m2=(*inertia, 0.0, 0.0, 0.0)))
    found = vehicle_responses(wrong, flights, by_repeats(flights))
    for name in ("roll", "pitch"):
        (only,) = found[name].deviations
        assert not only.right
        assert only.gain == pytest.approx(1 / factor, rel=0.03)
        assert found[name].cost > 80.0


def test_a_lag_that_is_not_there_is_seen(flights):
    slow = VehicleModel(vehicle=SMALL.vehicle, response=RotorResponse(lag_s=0.03))
    found = vehicle_responses(slow, flights, by_repeats(flights))["roll"]
    widest = max((each for each in found.deviations if not each.right), key=lambda each: each.high / each.low)
    assert widest.high > 10.0
    late = np.degrees(np.arctan(2 * np.pi * np.geomspace(widest.low, widest.high, 30) * 0.03))
    assert widest.phase == pytest.approx(-late.mean(), abs=3.0)


def test_specific_force_of_velocity_is_that_of_an_accelerometer(flights):
    """A derivative by parts, so that no velocity is differentiated."""
    part = flights[0].parts[0]
    assert part.thrust is not None
    felt = np.gradient(part.velocity, part.period, axis=0) + np.array([0.0, 0.0, part.vehicle.gravity_m_s2])
    along = np.einsum("tji,tj->ti", part.rotation, felt)
    measured = replace(flights[0], parts=(replace(part, specific_force=along),))
    assert specific_force(measured.parts[0]).integral is None
    one, other = (vehicle_responses(RIGHT, [each])["thrust"] for each in (flights[0], measured))
    clear = (one.coherence > 0.9) & (one.frequency < 4.0)
    assert clear.any()
    assert np.abs(other.gain / one.gain - 1)[clear].max() < 0.05


def test_speeds_follow_their_commands(flights):
    """A lag of 50 ms behind the commands is found whatever the gusts, and that of the model stands next to it."""
    part = flights[0].parts[0]
    behind = RotorResponse(lag_s=0.05)
    speed = behind.terms_at_samples(part.rotor_speed, part.period, "linear")[:, 1:5]
    logged_both = replace(flights[0], parts=(replace(part, rotor_speed=speed, rotor_command=part.rotor_speed),))
    model = VehicleModel(vehicle=SMALL.vehicle, response=behind, commanded=True, hold="linear")
    found = vehicle_responses(model, [logged_both])["rotor speed"]
    lag = 1 / (1 + 2j * np.pi * found.frequency * 0.05)
    assert np.abs(found.gain / lag - 1)[found.frequency < 10.0].max() < 0.03
    assert found.cost < 1.0
    assert vehicle_responses(RIGHT, [logged_both])["rotor speed"].model is None


def test_a_flight_in_parts_is_one_flight(flights):
    halves = [slice(0, 1900), slice(2100, len(flights[0].parts[0]))]
    cut = [replace(f, parts=tuple(_part(f.parts[0], half) for half in halves)) for f in flights]
    assert vehicle_responses(RIGHT, cut, by_repeats(cut))["roll"].cost < 10.0


def _part(signals, part):
    from cpfls_cli.effects.signals import stretch_of

    return stretch_of(signals, part)


def test_a_flight_of_a_second_is_refused(flights):
    short = replace(flights[0], parts=(_part(flights[0].parts[0], slice(0, 80)),))
    with pytest.raises(InputError, match=r"gusty-0: the longest stretch without a pause is 0\.8 s"):
        vehicle_responses(RIGHT, [short])
