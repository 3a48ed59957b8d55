"""Numbers of a flight in closed loop next to the truth it was flown with."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.changes.judge import FALSE_ALARM, NAMED, changed
from cpfls_cli.changes.numbers import KINDS, flight_numbers, in_flight
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.lag import delayed
from cpfls_cli.rotations import body_rate, rotation_matrix
from cpfls_cli.stages.changed import flown_unlike as said
from tests.builders.changed_flights import WEAK, flight_table
from tests.builders.closed_loop_flights import PERIOD, VEHICLE, flown, signals_of

NOISE = {"body_rate": 0.01, "attitude": 0.003, "velocity": 0.01, "acceleration": 0.1}
LOAD = {
    "mass": 0.6, "mass_times_depth": 0.0, "mass_times_right": 0.0, "mass_times_behind": 0.0, "length_m": 1.0,
    "damping_1_s": 0.1, "depth_m": 0.0,
}  # fmt: skip


def recorded(vehicle=VEHICLE, seed=1, **closed_loop):
    return replace(
        signals_of(flown(duration=12.0, seed=seed, vehicle=vehicle, noise=NOISE, **closed_loop)), name="flight.h5"
    )


def without_velocity():
    """Record what no load's swing is looked for in, which takes most of the time."""
    return replace(recorded(), velocity=None)


@pytest.fixture(scope="module")
def usual():
    return flight_numbers(recorded())


def test_names_and_noise(usual):
    assert {name.split()[0] for name in usual.values} <= set(KINDS)
    assert usual.values.keys() == usual.errors.keys()
    # Of white noise a parabola through five samples leaves the same share each time.
    of_gyroscope = np.exp([usual.values[f"vibration gyroscope {axis}"] for axis in "xyz"])
    assert of_gyroscope == pytest.approx(np.full(3, 0.01 * np.sqrt(18 / 35)), rel=0.1)
    assert usual.values["gain roll"] == pytest.approx(0.0, abs=0.05)
    assert usual.values["delay roll"] == pytest.approx(0.0, abs=0.002)
    assert abs(usual.values["swing"]) < 0.01
    assert np.isnan(usual.voltage)


def turning(rate, given):
    """Turn a hover: a damping about yaw slows the rotors that turn one way, and lets the others turn faster."""
    spins = np.array([rotor.spin for rotor in VEHICLE.rotors])
    still = given.speed.mean(axis=0)
    return replace(
        given,
        velocity=None,
        attitude=PERIOD * np.cumsum(rate)[:, None] * [0.0, 0.0, 1.0],
        body_rate=rate[:, None] * [0.0, 0.0, 1.0],
        rotor_speed=still * np.sqrt(1 - 0.1 * rate[:, None] * spins),
    )


def thrusts(signals):
    values = flight_numbers(replace(signals, name="flight.h5")).values
    return np.array([values[f"thrust M{index}"] for index in range(1, 5)])


def test_who_turns_to_one_side_against_the_air_has_no_weak_rotors():
    """What the rotors of one spin turn more against a damping about yaw goes with the rate, and leaves with it."""
    given = recorded()
    rate = 0.2 + 0.5 * np.sin(2 * np.pi * (given.time - given.time[0]) / 6.0)
    straight = thrusts(turning(0 * rate, given))
    assert thrusts(turning(rate, given)) == pytest.approx(straight, abs=0.003)


def test_who_turns_evenly_says_nothing_of_a_torque_about_z():
    """The damping is not separated from the rotors' drag, and shares are as certain as of a flight straight ahead."""
    given, rng = recorded(), np.random.default_rng(2)

    def numbers(rate, name):
        return replace(flight_numbers(turning(rate + 0.001 * rng.normal(size=len(given)), given)), name=name)

    before = [numbers(rate, f"{rate}") for rate in (0.0, 0.01, -0.01, 0.02, -0.02)]
    today = numbers(1.0, "today")
    assert max(today.errors[f"thrust M{index}"] for index in range(1, 5)) < 0.01
    assert today.turning == pytest.approx(1.0, abs=0.05)
    result = changed([today], before, VEHICLE, rng)
    assert result.p > FALSE_ALARM
    assert any(note.startswith("turns unlike the reference: ") for note in said(result, [today], before, VEHICLE))
    assert changed([replace(today, turning=0.0)], before, VEHICLE, rng).p <= FALSE_ALARM


def test_a_weak_rotor_is_asked_for_more(usual):
    """Of a cross each rotor carries its share alone, but for what its drag turns about z."""
    rotors = list(VEHICLE.rotors)
    rotors[2] = replace(rotors[2], thrust_factor_n_s2=(1 - 0.2) * rotors[2].thrust_factor_n_s2)
    result = flight_numbers(recorded(replace(VEHICLE, rotors=tuple(rotors))))
    more = [result.values[f"thrust M{index}"] - usual.values[f"thrust M{index}"] for index in range(1, 5)]
    # The drag factor stayed: M3 turns faster, so that all others have to hold it.
    assert more[2] > 0.1
    assert int(np.argmax(more)) == 2


def test_a_load_on_a_cable():
    """Mass and length of a load, next to three flights without, each of a day of its own."""
    rng = np.random.default_rng(4)

    def of_a_day(seed, **closed_loop):
        trim = [
            replace(rotor, thrust_factor_n_s2=rotor.thrust_factor_n_s2 * (1 + 0.01 * rng.normal()))
            for rotor in VEHICLE.rotors
        ]
        return recorded(replace(VEHICLE, rotors=tuple(trim)), seed, **closed_loop)

    before = [flight_numbers(of_a_day(seed)) for seed in range(10, 13)]
    today = flight_numbers(of_a_day(20, effects={"payload": LOAD}))
    found = changed([today], before, VEHICLE, rng)
    assert found.p <= FALSE_ALARM
    (load,) = found.causes
    assert load.name == "load on a cable"
    assert load.belief > NAMED
    assert load.sizes[0].low < 0.1 < load.sizes[0].high
    assert today.cable_m == pytest.approx(1.0, rel=0.05)


def test_a_gyroscope_that_is_mounted_turned():
    """Against an attitude that is measured by another sensor."""
    given, angles = without_velocity(), np.array([0.05, -0.04, 0.08])
    remounted = replace(given, body_rate=given.body_rate @ rotation_matrix(angles[None])[0], name="flight.h5")
    before, today = (flight_numbers(replace(each, name="flight.h5")).values for each in (given, remounted))
    found = [today[f"axes {axis}"] - before[f"axes {axis}"] for axis in "xyz"]
    assert found == pytest.approx(angles, abs=0.005)


def test_a_gyroscope_that_is_turned_about_z_on_paths_that_roll_and_pitch_at_once():
    """The turn is no scale of the axes, whose rates go together, and its error no larger than without it."""
    given = without_velocity()
    time = given.time - given.time[0]
    roll, apart, yaw = (np.sin(2 * np.pi * time / period) for period in (2.1, 3.4, 6.3))
    attitude = 0.1 * np.stack([roll, 0.3 * apart - roll, yaw], axis=1)
    rate = body_rate(attitude, np.gradient(attitude, given.period, axis=0))
    rate += 1e-3 * np.random.default_rng(3).normal(size=rate.shape)
    straight = replace(given, attitude=attitude, body_rate=rate, name="flight.h5")
    turned = replace(straight, body_rate=rate @ rotation_matrix(np.array([[0.0, 0.0, 0.1]]))[0])
    before, today = flight_numbers(straight), flight_numbers(turned)
    assert today.values["axes z"] - before.values["axes z"] == pytest.approx(0.1, abs=0.002)
    assert today.errors["axes z"] < 1.5 * before.errors["axes z"]


def test_a_mass_that_is_fixed_does_not_swing(usual):
    """Whatever it weighs: thrust that is larger than the mass of the config asks for accelerates no load."""
    heavier = flight_numbers(recorded(replace(VEHICLE, mass_kg=1.2 * VEHICLE.mass_kg)))
    assert heavier.values["swing"] == pytest.approx(usual.values["swing"], abs=0.01)
    assert heavier.values["thrust M1"] - usual.values["thrust M1"] == pytest.approx(np.log(1.2), abs=0.05)


def test_an_unbalanced_rotor_above_half_of_the_rate():
    """It turns 55 times a second in a log of 100 Hz: by its speed it is known where it stands."""
    signals = without_velocity()
    assert signals.rotor_speed.mean() / (2 * np.pi) > 0.5 / PERIOD
    speed = signals.rotor_speed * [1.0, 1.1, 0.95, 1.05]
    turns = PERIOD * (np.cumsum(speed[:, 1]) - 0.5 * speed[:, 1])
    pull = 0.5 * np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    still, shaken = (
        np.exp([flight_numbers(replace(each, name="flight.h5")).values[f"unbalance M{index}"] for index in range(1, 5)])
        for each in (replace(signals, rotor_speed=speed, acceleration=signals.acceleration + x * pull) for x in (0, 1))
    )
    assert still.max() < 0.1
    assert shaken[1] == pytest.approx(0.5 * np.sqrt(2), rel=0.05)
    # Speeds of two rotors cross now and then.
    assert shaken[[0, 2, 3]].max() < 0.5 * shaken[1]


def test_rotors_that_turn_nearly_alike_are_distinguished():
    """Speeds 1.5 Hz apart, of which one shakes: alone it would be felt by the other too."""
    signals = without_velocity()
    speed = 2 * np.pi * np.array([105.0, 106.5, 111.0, 118.0]) * np.ones((len(signals), 1))
    turns = PERIOD * (np.cumsum(speed[:, 1]) - 0.5 * speed[:, 1])
    pull = 0.5 * np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    shaken = replace(signals, rotor_speed=speed, acceleration=0.01 * signals.acceleration + pull)
    values = flight_numbers(replace(shaken, name="flight.h5")).values
    amplitudes = np.exp([values[f"unbalance M{index}"] for index in range(1, 5)])
    assert amplitudes[1] == pytest.approx(0.5 * np.sqrt(2), rel=0.1)
    assert amplitudes[[0, 2, 3]].max() < 0.15 * amplitudes[1]


def test_what_turns_105_times_a_second_vibrates_in_a_log_of_100_hz():
    """There it seems to swing five times a second."""
    signals = without_velocity()
    turns = 2 * np.pi * (1 / PERIOD + 5.0) * signals.time
    felt = np.stack([0.5 * np.cos(turns), 0.5 * np.sin(turns), 9.81 + 0 * turns], axis=1)
    values = flight_numbers(replace(signals, specific_force=felt, name="flight.h5")).values
    across = np.exp([values[f"vibration accelerometer {axis}"] for axis in "xy"])
    assert across == pytest.approx(np.full(2, 0.5 / np.sqrt(2)), rel=0.15)


def test_too_short_and_without_rotors():
    flight = recorded()
    few = round(3.0 / PERIOD)
    parts = {name: getattr(flight, name)[:few] for name in ("time", "body_rate", "attitude", "rotor_speed")}
    short = replace(flight, **parts, velocity=None, position=None, acceleration=None)
    with pytest.raises(InputError, match="flies for 3 s"):
        flight_numbers(replace(short, name="short.csv"))
    with pytest.raises(InputError, match="has no rotor_speed or rotor_command"):
        flight_numbers(replace(flight, rotor_speed=None, name="none.csv"))


def test_the_ground_is_no_flight_and_throttle_cuts_of_acrobatic_flight_are():
    """Five seconds of idling before: not flown, nor half a second next to it."""
    signals = recorded()
    idle = signals.rotor_speed.copy()
    idle[:500] *= 0.2
    flies = in_flight(replace(signals, rotor_speed=idle, position=None))
    assert not flies[:549].any()
    assert flies[560:].all()
    # As the import has it: a second of each three with the throttle cut, in which the vehicle turns.
    signals = recorded()
    speed = np.where((np.mod(signals.time, 3.0) > 2.0)[:, None], 0.05, 1.0) * signals.rotor_speed
    turns = signals.body_rate + 3.0 * np.sin(5 * signals.time)[:, None] * [1.0, 1.0, 0.0]
    lively = replace(signals, rotor_speed=speed, body_rate=turns, position=None, attitude=None)
    assert in_flight(lively)[: -round(1.5 / PERIOD)].all()


def test_a_weak_rotor_turns_the_body_less_however_thrust_and_yaw_turn_it_too():
    """Of a cross M3 does half of the pitch; what it lacks of thrust and yaw pitches the body next to that."""

    def follows(*does):
        time, *columns = flight_table(3, does).T
        speed = np.stack(columns[6:10], axis=1)
        signals = Signals(
            time=time, vehicle=VEHICLE, body_rate=np.stack(columns[:3], axis=1), rotor_speed=speed, commanded=True
        )
        result = flight_numbers(replace(signals, name="flight.csv")).values
        return np.array([result["gain roll"], result["gain pitch"]])

    less = follows(*WEAK) - follows(1.0, 1.0, 1.0, 1.0)
    assert less == pytest.approx([0.0, np.log(0.9)], abs=0.03)


def test_a_lean_against_wind_is_no_fault_of_the_accelerometer():
    """It feels gravity along its own axes however it leans; what it feels next to is its own, ahead and to the left."""
    signals = without_velocity()
    tilted = replace(signals, attitude=np.array([0.1, -0.15, 2.0]) + np.zeros((len(signals), 3)))
    feels = np.einsum("tji,j->ti", tilted.rotation, [0.0, 0.0, 9.81])
    calm, biased = (
        flight_numbers(replace(tilted, specific_force=feels + bias, name="flight.h5")).values
        for bias in (np.zeros(3), np.array([0.1, 0.2, 0.3]))
    )
    assert [calm[f"felt {axis}"] for axis in "xyz"] == pytest.approx(np.zeros(3), abs=1e-9)
    assert [biased[f"felt {axis}"] for axis in "xyz"] == pytest.approx([0.1, 0.2, 0.3], abs=0.06)


def test_how_late_a_rotor_answers():
    """Speeds that are those of the flight 24 ms ago, but of one rotor 34 ms."""
    signals = without_velocity()
    late = np.array([0.024, 0.024, 0.034, 0.024])
    speed = np.stack(
        [delayed(own[:, None], each / PERIOD)[:, 0] for own, each in zip(signals.speed.T, late, strict=True)], axis=1
    )
    result = flight_numbers(replace(signals, rotor_speed=speed, rotor_command=signals.speed, name="flight.h5")).values
    assert [result[f"lag M{index}"] for index in range(1, 5)] == pytest.approx(late, abs=0.002)


def test_a_gyroscope_of_another_scale(usual):
    """Next to an attitude that is right; about one axis."""
    flight = recorded()
    rates = flight.body_rate * [1.1, 1.0, 1.0]
    result = flight_numbers(replace(flight, body_rate=rates, name="flight.h5"))
    more = [result.values[f"scale {axis}"] - usual.values[f"scale {axis}"] for axis in "xyz"]
    assert more == pytest.approx([np.log(1.1), 0.0, 0.0], abs=1e-3)
    assert abs(usual.values["scale x"]) < 0.02
