"""A flight's own setpoints flown again: the vehicle that flew parts nowhere, another one where it is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulation.closed_loop import ClosedLoop
from cpfls_cli.simulation.twin import (
    CHANNELS,
    DRAWS,
    RATE_LAW,
    TwinVehicle,
    asked_of,
    baselines,
    compared,
    fly_in_gusts,
    fly_twin,
    in_gusts,
    known_axes,
    measured_channels,
    windows,
)
from tests.builders.autopilots import CROSS
from tests.builders.twins import GUSTS, HOVER, LOOP, PERIOD, flown

INERTIA = CROSS.inertia_kg_m2


@pytest.fixture(scope="module")
def flight():
    return flown()


def comparison(flight, vehicle=CROSS, loop=LOOP):
    asked = asked_of(flight, loop, CROSS, share=True)
    twin = fly_twin(ClosedLoop(CROSS, loop, VehicleModel(vehicle=vehicle)), flight, asked)
    return compared(flight, asked, measured_channels(flight), twin.simulated, lambda _given: None)


@pytest.fixture(scope="module")
def right(flight):
    return comparison(flight)


def costs(found):
    return {name: each.cost for name, each in found.items() if each.judged}


def apart(found):
    return {name for name, each in found.items() if each.apart.any()}


def test_the_vehicle_that_flew_parts_nowhere_beyond_gusts_and_noise(right):
    found, judged = right, costs(right)
    assert {"roll rate", "pitch rate", "roll", "pitch"} <= set(judged)
    assert max(judged.values()) < 50
    assert apart(found) == set()
    # What differs is of gusts: nearly all of it follows no setpoint.
    assert found["roll rate"].floor == pytest.approx(found["roll rate"].rms, rel=0.15)


def test_a_wrong_moment_of_inertia_parts_its_axis_at_high_frequencies(flight, right):
    wrong = comparison(flight, replace(CROSS, inertia_kg_m2=(2 * INERTIA[0], *INERTIA[1:])))
    judged = costs(wrong)
    assert judged["roll rate"] > 100
    assert judged["pitch rate"] < 50
    assert {"roll rate"} <= apart(wrong) <= {"roll rate", "roll"}
    roll = wrong["roll rate"]
    off = [each for each in roll.deviations if not each.right]
    assert off
    assert min(each.low for each in off) > 1.0
    # A heavier body turns later and less.
    assert all(each.phase < 0 or each.gain < 1 for each in off)
    assert roll.rms > 1.3 * right["roll rate"].rms
    assert roll.floor < 0.85 * roll.rms


def test_slow_rotors_part_roll_and_pitch_alike(flight):
    judged = costs(comparison(flight, loop=replace(LOOP, rotor_time_constant_s=0.08)))
    assert min(judged["roll rate"], judged["pitch rate"]) > 100


def test_without_gusts_the_same_flight_comes_back():
    (part,) = flown(3.0, gusts=False).parts
    # The rotors begin where the thrust that is asked for has them, as they did.
    flight = LoggedFlight.of(replace(part, name="flight", rotor_speed=None))
    asked = asked_of(flight, LOOP, CROSS, share=True)
    measured = measured_channels(flight)
    twin = fly_twin(ClosedLoop(CROSS, LOOP), flight, asked)
    np.testing.assert_allclose(twin.simulated, measured, atol=1e-9)
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
    twin = fly_twin(ClosedLoop(CROSS, LOOP, other), flight, asked)
    assert 0 < twin.lost_s < 1.5
    known = np.isfinite(twin.simulated).all(axis=1)
    assert known[: round(twin.lost_s / PERIOD)].all()
    assert not known[round(twin.lost_s / PERIOD) :].any()


def changed(flight, **setpoints):
    (part,) = flight.parts
    return LoggedFlight.of(replace(part, name="other", setpoints=setpoints))


def test_rates_are_flown_where_no_attitude_is_asked_for(flight):
    (part,) = flight.parts
    asked = asked_of(changed(flight, body_rate=part.body_rate), LOOP, CROSS, share=True)
    assert (asked.kind, asked.thrust_from) == (RATE_LAW, "rotors")
    assert asked.setpoints[0].attitude is None
    # The mixer lifts all rotors where one would have to push.
    assert np.median(asked.setpoints[0].thrust) == pytest.approx(HOVER, rel=0.1)
    with pytest.raises(InputError, match="map them as setpoint_attitude"):
        asked_of(changed(flight), LOOP, CROSS, share=True)


def test_a_thrust_in_newton_is_the_share_that_gives_it(flight):
    share = asked_of(flight, LOOP, CROSS, share=True).setpoints[0]
    lift = CROSS.rotor_speed_max_rad_s**2 * sum(rotor.thrust_factor_n_s2 for rotor in CROSS.rotors)
    (part,) = flight.parts
    # Of this law the signal is the share, and the thrust goes with its square.
    newton = changed(flight, **{**part.setpoints, "thrust": np.full((len(part), 1), lift * HOVER**2)})
    given = asked_of(newton, LOOP, CROSS, share=False).setpoints[0]
    np.testing.assert_allclose(given.thrust, share.thrust, rtol=1e-6)


def test_a_flight_in_the_same_gusts_is_one_of_those_in_gusts_and_that_of_a_heavier_body_is_not():
    loop = replace(LOOP, integration_rate_hz=200.0)
    model = VehicleModel(vehicle=CROSS, gusts=GUSTS)
    flights = {ratio: flown(3.0, inertia_x=ratio) for ratio in (1.0, 2.5)}
    asked = asked_of(flights[1.0], loop, CROSS, share=True)
    still = fly_twin(ClosedLoop(CROSS, loop, model), flights[1.0], asked)
    gusty = fly_in_gusts(ClosedLoop(CROSS, loop), flights[1.0], asked, [model] * 7, None, drawing(1))
    blown = known_axes(GUSTS, None)
    found = {
        ratio: in_gusts(measured_channels(own), still.simulated, gusty, blown, drawing(2))
        for ratio, own in flights.items()
    }
    assert found[1.0].beyond == []
    assert "roll rate" in found[2.5].beyond
    # None of the gyroscope's noise in a flight is taken for the vehicle's.
    rates = [found[1.0].channels[name] for name in CHANNELS[:3]]
    assert [each.noise for each in rates] == pytest.approx([0.01] * 3, abs=0.005)
    assert tuple(found[1.0].channels) == CHANNELS
    assert all(np.isfinite(each.drawn).all() for each in found[1.0].channels.values())
    assert all(np.isfinite(each.low).all() for each in found[1.0].channels.values())


def drawing(seed):
    return np.random.default_rng(seed)


def among(rng, larger=1.0):
    """A flight among others: walks that differ in their size from channel to channel, the first one larger."""
    size = rng.uniform(0.5, 2.0, len(CHANNELS)) * np.exp(0.3 * rng.standard_normal((1 + DRAWS, 1, len(CHANNELS))))
    size[0, :, 3] *= larger
    walks = size * np.cumsum(rng.standard_normal((1 + DRAWS, 60, len(CHANNELS))), axis=1)
    others = [TwinVehicle(lost_s=np.nan, simulated=values, position=values[:, :3], channels={}) for values in walks[1:]]
    return in_gusts(walks[0], np.zeros_like(walks[0]), others, np.ones(6, dtype=bool), rng)


def test_one_flight_of_twenty_that_is_like_the_others_is_said_not_to_be():
    rng = drawing(5)
    result = [bool(among(rng).beyond) for _ in range(400)]
    # 20 are expected; 4 deviations of a binomial on either side.
    assert 3 <= sum(result) <= 37
    larger = [among(rng, 20.0).beyond for _ in range(50)]
    assert all("roll" in beyond for beyond in larger)
    # Its other channels are said no more often.
    assert sum(len(beyond) > 1 for beyond in larger) <= 8


def test_channels_that_no_known_gust_moves_are_not_held():
    gusts = Gusts(GUSTS.size * [1, 1, 0, 1, 0, 1], GUSTS.memory)
    assert known_axes(gusts, None).tolist() == [True, True, False, True, False, True]
    walks = np.cumsum(drawing(1).standard_normal((4, 60, len(CHANNELS))), axis=1)
    others = [TwinVehicle(lost_s=np.nan, simulated=values, position=values[:, :3], channels={}) for values in walks[1:]]
    found = in_gusts(walks[0], 0 * walks[0], others, known_axes(gusts, None), drawing(1))
    assert list(found.channels) == ["roll rate", "pitch rate", "roll", "pitch", "velocity z", "thrust"]
