"""A flight's own setpoints flown again: the vehicle that flew parts nowhere, another one where it is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulation.model import SimulatedEffects
from cpfls_cli.simulation.twin import (
    CHANNELS,
    RATE_LAW,
    asked_of,
    baselines,
    compared,
    fly_twin,
    is_apart,
    measured_channels,
    windows,
)
from tests.builders.autopilots import CROSS
from tests.builders.twins import HOVER, LOOP, PERIOD, flown

INERTIA = CROSS.inertia_kg_m2


@pytest.fixture(scope="module")
def flight():
    return flown()


def comparison(flight, vehicle=CROSS, loop=LOOP):
    asked = asked_of(flight, loop, CROSS, share=True)
    twin = fly_twin(flight, asked, CROSS, loop, VehicleModel(vehicle=vehicle), SimulatedEffects())
    return compared(flight, asked, measured_channels(flight), twin.values, lambda _given: None)


@pytest.fixture(scope="module")
def right(flight):
    return comparison(flight)


def costs(found):
    return {
        name: each.cost
        for name, each in zip(CHANNELS, found.mismatches, strict=True)
        if each is not None and np.isfinite(each.cost)
    }


def apart(found):
    return {name for name, marked in zip(CHANNELS, is_apart(found).any(axis=0), strict=True) if marked}


def test_the_vehicle_that_flew_parts_nowhere_beyond_gusts_and_noise(right):
    found, judged = right, costs(right)
    assert {"roll rate", "pitch rate", "roll", "pitch"} <= set(judged)
    assert max(judged.values()) < 50
    assert apart(found) == set()
    # What differs is of gusts: nearly all of it follows no setpoint.
    assert found.floor[0] == pytest.approx(found.rms[0], rel=0.15)


def test_a_wrong_moment_of_inertia_parts_its_axis_at_high_frequencies(flight, right):
    wrong = comparison(flight, replace(CROSS, inertia_kg_m2=(2 * INERTIA[0], *INERTIA[1:])))
    judged = costs(wrong)
    assert judged["roll rate"] > 100
    assert judged["pitch rate"] < 50
    assert {"roll rate"} <= apart(wrong) <= {"roll rate", "roll"}
    off = [each for each in wrong.mismatches[0].deviations if not each.right]
    assert off
    assert min(each.low for each in off) > 1.0
    # A heavier body turns later and less.
    assert all(each.phase < 0 or each.gain < 1 for each in off)
    assert wrong.rms[0] > 1.3 * right.rms[0]
    assert wrong.floor[0] < 0.85 * wrong.rms[0]


def test_slow_rotors_part_roll_and_pitch_alike(flight):
    judged = costs(comparison(flight, loop=replace(LOOP, rotor_time_constant_s=0.08)))
    assert min(judged["roll rate"], judged["pitch rate"]) > 100


def test_without_gusts_the_same_flight_comes_back():
    (part,) = flown(3.0, gusts=False).parts
    # The rotors begin where the thrust that is asked for has them, as they did.
    flight = LoggedFlight.of("flight", replace(part, rotor_speed=None))
    asked = asked_of(flight, LOOP, CROSS, share=True)
    measured = measured_channels(flight)
    twin = fly_twin(flight, asked, CROSS, LOOP, None, SimulatedEffects())
    np.testing.assert_allclose(twin.values, measured, atol=1e-9)
    assert np.isnan(twin.lost_s)
    setpoint, still = baselines(flight, measured)
    np.testing.assert_array_equal(setpoint[:, 3:6], flight.parts[0].setpoints["attitude"])
    assert np.isnan(setpoint[:, :3]).all()
    assert (still == measured[0]).all()
    assert [len(measured[part]) for part in windows(flight)] == [50, 50, 50, 1]


def test_a_vehicle_that_is_lost_is_known_up_to_there():
    flight = flown(1.5, gusts=False)
    # What the law takes for roll turns the other way.
    rotors = tuple(replace(r, position_m=(r.position_m[0], -r.position_m[1], 0.0)) for r in CROSS.rotors)
    other = VehicleModel(vehicle=replace(CROSS, rotors=rotors))
    asked = asked_of(flight, LOOP, CROSS, share=True)
    twin = fly_twin(flight, asked, CROSS, LOOP, other, SimulatedEffects())
    assert 0 < twin.lost_s < 1.5
    known = np.isfinite(twin.values).all(axis=1)
    assert known[: round(twin.lost_s / PERIOD)].all()
    assert not known[round(twin.lost_s / PERIOD) :].any()


def changed(flight, **setpoints):
    (part,) = flight.parts
    return LoggedFlight.of("other", replace(part, setpoints=setpoints))


def test_rates_are_flown_where_no_attitude_is_asked_for(flight):
    (part,) = flight.parts
    asked = asked_of(changed(flight, body_rate=part.body_rate), LOOP, CROSS, share=True)
    assert (asked.kind, asked.thrust_from) == (RATE_LAW, "rotors")
    assert asked.setpoints[0].attitude is None
    # The mixer lifts all rotors where one would have to push.
    assert np.median(asked.setpoints[0].thrust) == pytest.approx(HOVER, rel=0.1)
    with pytest.raises(InputError, match="map setpoint_attitude"):
        asked_of(changed(flight), LOOP, CROSS, share=True)


def test_a_thrust_in_newton_is_the_share_that_gives_it(flight):
    share = asked_of(flight, LOOP, CROSS, share=True).setpoints[0]
    lift = CROSS.rotor_speed_max_rad_s**2 * sum(rotor.thrust_factor_n_s2 for rotor in CROSS.rotors)
    (part,) = flight.parts
    # Of this law the signal is the share, and the thrust goes with its square.
    newton = changed(flight, **{**part.setpoints, "thrust": np.full((len(part), 1), lift * HOVER**2)})
    given = asked_of(newton, LOOP, CROSS, share=False).setpoints[0]
    np.testing.assert_allclose(given.thrust, share.thrust, rtol=1e-6)
