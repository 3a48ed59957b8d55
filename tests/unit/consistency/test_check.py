"""What of a flight contradicts itself is said, and nothing else: faults made on purpose, and flights without any."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.consistency.check import check
from cpfls_cli.consistency.majority import shaken_in_words
from cpfls_cli.consistency.rotors import beyond_belief, beyond_propellers
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.settings import GapSettings
from tests.builders.closed_loop_flights import COARSE, PERIOD, VEHICLE, flown, signals_of

SETTINGS = GapSettings()
NOISE = {"body_rate": 0.01, "attitude": 0.003, "velocity": 0.02, "position": 0.005, "acceleration": 0.1}
UP_IS_DOWN = np.array([1.0, 1.0, -1.0])


@pytest.fixture(scope="module")
def flight():
    return signals_of(flown(12.0, noise=NOISE, integration_rate_hz=COARSE))


@pytest.fixture(scope="module")
def lively():
    return signals_of(flown(20.0, noise=NOISE, also=0.05, integration_rate_hz=COARSE))


def said(signals):
    return " ".join(finding.sentence for finding in check([signals], SETTINGS))


def cut(signals, part):
    known = ("time", "body_rate", "attitude", "velocity", "position", "acceleration", "rotor_speed")
    return replace(signals, **{name: getattr(signals, name)[part] for name in known})


def with_vehicle(signals, **changes):
    return replace(signals, vehicle=replace(VEHICLE, **changes))


def guessed(signals, factor):
    """A flight of a vehicle whose thrust factor is a guess, wrong by a factor."""
    rotors = tuple(replace(each, thrust_factor_n_s2=factor * each.thrust_factor_n_s2) for each in VEHICLE.rotors)
    return with_vehicle(signals, rotors=rotors, unknown=("thrust_factor",))


def test_nothing_is_said_of_a_flight_that_agrees_with_itself(flight):
    assert check([flight], SETTINGS) == ()


@pytest.mark.parametrize(
    ("scatter", "words"), [(0.0, ""), (2.0, "; along z it scatters by 2 m/s^2 from one of 100 samples")]
)
def test_an_accelerometer_that_scatters_more_than_the_motion_is_said_to_vibrate(flight, scatter, words):
    felt = np.einsum("tji,tj->ti", flight.rotation, flight.acceleration + np.array([0.0, 0.0, 9.80665]))
    felt[:, 2] += scatter * np.random.default_rng(2).standard_normal(len(felt))
    said = shaken_in_words([flight, replace(flight, specific_force=felt)])
    assert said.startswith(words)
    assert bool(said) == bool(words)


def test_a_touchdown_is_no_flight(flight):
    """Of what jolts a vehicle that lands the accelerometer and the velocity, each filtered, show unlike parts."""
    rest, down = np.arange(1, 401), np.array([0.0, 0.0, 1.0])
    fall, jolt = ((begin <= rest) & (rest < begin + 40) for begin in (1, 81))

    def then(values, later):
        return np.concatenate([values, np.broadcast_to(later, (len(rest), *values.shape[1:]))])

    landed = replace(
        flight,
        time=np.concatenate([flight.time, flight.time[-1] + PERIOD * rest]),
        **{name: then(getattr(flight, name), 0.0) for name in ("body_rate", "rotor_speed")},
        **{name: then(getattr(flight, name), getattr(flight, name)[-1:]) for name in ("position", "attitude")},
        velocity=then(flight.velocity, flight.velocity[-1:] - 4.0 * fall[:, None] * down),
        acceleration=then(flight.acceleration, 20.0 * jolt[:, None] * down),
    )
    assert check([landed], SETTINGS) == ()


@pytest.mark.parametrize("factor", [1e-3, 0.1, 30.0])
def test_a_thrust_factor_that_is_a_guess_contradicts_nothing(flight, factor):
    assert check([guessed(flight, factor)], SETTINGS) == ()


def times(**factors):
    """Read channels by factors of what they are."""
    return lambda s: replace(s, **{name: getattr(s, name) * np.array(by) for name, by in factors.items()})


def plus(**offsets):
    return lambda s: replace(s, **{name: getattr(s, name) + np.array(by) for name, by in offsets.items()})


upside_down = times(**dict.fromkeys(("velocity", "position", "acceleration"), UP_IS_DOWN))
FAULTS = {
    "velocity in km/h": (times(velocity=3.6), "the velocity is in km/h"),
    "velocity in mm/s": (times(velocity=1e3), "the velocity is in mm/s"),
    "acceleration with gravity": (plus(acceleration=[0.0, 0.0, 9.80665]), "or leave import.signals.acceleration out"),
    "metres for millimetres": (
        times(position=1e-3, velocity=1e-3),
        "times what tilt and gravity make it: check import.signals.velocity.unit",
    ),
    "velocity swapped": (
        lambda s: replace(s, velocity=s.velocity[:, [1, 0, 2]]),
        "the velocity has y, x, z where x, y, z should be",
    ),
    "velocity down": (times(velocity=UP_IS_DOWN), "the velocity has x, y, -z"),
    "position in mm": (times(position=1e3), ": is the position in mm"),
    "acceleration in g": (times(acceleration=1 / 9.80665), "the acceleration is in g"),
    "world down": (upside_down, "along z, the thrust of the rotors is opposite to"),
    "world down, thrust unknown": (lambda s: upside_down(guessed(s, 30.0)), "opposite to velocity"),
    "rotors in another order": (
        lambda s: replace(s, rotor_speed=s.rotor_speed[:, [1, 0, 2, 3]]),
        "judged by the motion, the rotors are, in the order of their columns: right, clockwise; front, "
        "counter-clockwise; rear",
    ),
    "spins reversed": (
        lambda s: with_vehicle(s, rotors=tuple(replace(each, spin=-each.spin) for each in VEHICLE.rotors)),
        "front, counter-clockwise; right, clockwise; rear, counter-clockwise; left, clockwise (which explains",
    ),
    "heading turned": (
        plus(attitude=[0.0, 0.0, 1.0]),
        "judged by thrust and attitude, the axes of velocity and acceleration are rotated by -57 deg about the "
        "vertical",
    ),
    "world turned over its x": (
        times(**dict.fromkeys(("velocity", "position", "acceleration"), (1.0, -1.0, 1.0))),
        "judged by thrust and attitude, the axes of velocity and acceleration are mirrored",
    ),
    "hanging": (plus(attitude=[np.pi, 0.0, 0.0]), "according to its attitude, the vehicle is upside down on average"),
    "twice the mass": (
        lambda s: with_vehicle(s, mass_kg=2 * VEHICLE.mass_kg),
        "the thrust of the rotors is 0.50 times what the motion requires along the vertical",
    ),
    "gyroscope of another scale": (times(body_rate=1.3), "the gyroscope reads 30 % too much about x"),
    "gyroscope with a bias": (
        plus(body_rate=[0.0, 0.5, 0.0]),
        "the gyroscope shows a rate where there is none: +0.4998 rad/s about y",
    ),
    "gyroscope late": (
        lambda s: replace(s, body_rate=np.roll(s.body_rate, 5, axis=0)),
        "the gyroscope runs 49.9 ms behind the attitude",
    ),
    "speeds in rpm": (times(rotor_speed=60 / (2 * np.pi)), "times the weight on average"),
    "speeds in rpm, thrust unknown": (
        lambda s: times(rotor_speed=60 / (2 * np.pi))(guessed(s, 1.0)),
        "but vehicle.rotor_speed_max_rad_s is 1000",
    ),
    "speeds in turns a second": (times(rotor_speed=1 / (2 * np.pi)), "times the weight at most"),
    "speeds a tenth of the true ones, thrust unknown": (
        lambda s: replace(guessed(s, 1.0), rotor_speed=s.rotor_speed / 9.55),
        "propellers that fit between the hubs lift",
    ),
    "arms in mm, thrust unknown": (
        lambda s: with_vehicle(
            s,
            rotors=tuple(
                replace(each, position_m=tuple(1e3 * place for place in each.position_m)) for each in VEHICLE.rotors
            ),
            unknown=("thrust_factor",),
        ),
        "times more than the weight of",
    ),
    "a digit of the mass": (lambda s: with_vehicle(s, mass_kg=0.6), "times the weight on average"),
}


@pytest.fixture(scope="module")
def findings(flight):
    """What is said of a flight with a fault, found once."""
    return cache(lambda fault: check([FAULTS[fault][0](flight)], SETTINGS))


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_said(findings, fault):
    assert FAULTS[fault][1] in " ".join(finding.sentence for finding in findings(fault))


def test_rotors_that_idle_on_the_ground_are_said_and_contradict_nothing(flight):
    level = replace(guessed(flight, 1.0), attitude=0.001 * flight.attitude)
    for signals, contradicts in ((guessed(flight, 1.0), True), (level, False)):
        slow = replace(signals, rotor_speed=0.1 * flight.rotor_speed)
        (found,) = [each for each in check([slow], SETTINGS) if "propellers that fit" in each.what]
        assert found.contradiction == contradicts
        assert "whether it took off" in found.remedy


def test_rotors_above_each_other_do_not_touch(flight):
    """Of a coaxial vehicle the room is that between neighbours, not that between the hubs of one arm."""
    below = [replace(each, position_m=tuple(1.02 * place for place in each.position_m)) for each in VEHICLE.rotors]
    both = with_vehicle(flight, rotors=(*VEHICLE.rotors, *below), unknown=("thrust_factor",))
    speed = np.hstack([flight.rotor_speed, flight.rotor_speed])
    assert beyond_propellers([replace(both, rotor_speed=speed)]) is None


def test_rotors_on_another_clock_are_said(lively):
    assert said(lively) == ""
    assert "the rotor speeds are late by" in said(replace(lively, rotor_speed=np.roll(lively.rotor_speed, 5, axis=0)))


@pytest.mark.parametrize(
    ("off", "known", "words"), [(0.0, False, ""), (3.0, False, "2.9 m/s^2"), (3.0, True, "constant")]
)
def test_an_accelerometer_that_would_carry_it_away_is_said(lively, off, known, words):
    """Where a velocity is known it says more."""
    felt = np.einsum("tji,tj->ti", lively.rotation, lively.acceleration + np.array([0.0, 0.0, 9.80665]))
    own = replace(lively, acceleration=None, position=None, specific_force=felt + np.array([off, 0.0, 0.0]))
    found = said(own if known else replace(own, velocity=None))
    assert words in found
    assert ("it would be 57 m/s faster" in found) is (off > 0 and not known)
    assert bool(found) is (off > 0)


@pytest.mark.parametrize(("factors", "clock"), [((1.3, 1.3, 1.3), True), ((1.3, 1.0, 1.3), False)])
def test_a_gyroscope_that_is_off_alike_about_all_axes_may_be_a_clock(lively, factors, clock):
    words = said(times(body_rate=factors)(lively))
    assert "the gyroscope reads" in words
    assert ("the clock of the log" in words) is clock


def test_where_a_source_was_silent_nothing_is_compared(lively):
    late = replace(lively, attitude=np.roll(lively.attitude, 3, axis=0))
    frozen = late.body_rate.copy()
    frozen[800:1200] = frozen[800]
    both, one = (check([own], SETTINGS) for own in (replace(late, body_rate=frozen), late))
    assert [own.channels for own in both] == [own.channels for own in one] == [("attitude", "gyroscope")]
    assert both[0].size == pytest.approx(one[0].size, abs=0.002)


@pytest.mark.parametrize(("times", "idle"), [(0.3, 0.0), (0.3, 60.0), (0.3, 200.0), (9, 0.0), (9, 200.0), (60, 60.0)])
def test_a_long_rest_on_the_ground_contradicts_nothing(flight, times, idle):
    rng, count = np.random.default_rng(1), round(times * len(flight))
    start = {name: getattr(flight, name)[0] for name in ("attitude", "position")}
    still = {name: start.get(name, 0.0) + size * rng.standard_normal((count, 3)) for name, size in NOISE.items()}
    still["rotor_speed"] = np.full((count, 4), idle)
    both = {name: np.concatenate([values, getattr(flight, name)]) for name, values in still.items()}
    assert said(replace(flight, time=PERIOD * np.arange(count + len(flight)), **both)) == ""


def test_a_motionless_log_is_no_reason_to_stop(flight):
    count = len(flight)
    still = {name: np.zeros((count, 3)) for name in NOISE} | {"rotor_speed": np.zeros((count, 4))}
    assert "lifts no vehicle" in said(replace(flight, **still))


@pytest.mark.parametrize(
    ("inertia", "said"),
    [((0.6, 0.6, 1.2), 0), ((6.0, 0.6, 6.1), 2), ((365.0, 365.0, 700.0), 3), ((0.6, 0.6, 1.2, 0.1, 0.0, 0.0), 0)],
)
def test_an_inertia_of_no_such_body_is_said_unless_it_is_a_guess(inertia, said):
    stated = replace(VEHICLE, inertia_kg_m2=inertia)
    assert (len(beyond_belief(stated)), beyond_belief(replace(stated, unknown=("inertia",)))) == (said, ())
    assert all("Ixx" in each.what or "Iyy" in each.what or "Izz" in each.what for each in beyond_belief(stated))


def test_every_sentence_names_what_to_look_at(findings):
    for fault in FAULTS:
        assert all("import." in each.remedy or "vehicle." in each.remedy for each in findings(fault))


@pytest.mark.parametrize("seconds", [0.1, 0.5, 1.0])
def test_of_a_flight_too_short_for_windows_only_the_rotors_are_judged(flight, seconds):
    short = cut(flight, slice(0, round(seconds / PERIOD)))
    assert said(replace(short, velocity=3.6 * short.velocity)) == ""
    assert "times the weight" in said(replace(short, rotor_speed=9.55 * short.rotor_speed))


def test_each_stretch_is_looked_at(flight):
    halves = [cut(flight, slice(0, 600)), cut(flight, slice(600, None))]
    faulty = [replace(half, velocity=3.6 * half.velocity) for half in halves]
    assert check(halves, SETTINGS) == ()
    assert "km/h" in " ".join(finding.what for finding in check(faulty, SETTINGS))


def test_rotors_that_one_stretch_shows_clearly_are_said_of_all(flight):
    swapped = FAULTS["rotors in another order"][0](flight)
    steady = replace(flight, rotor_speed=np.full_like(flight.rotor_speed, flight.rotor_speed.mean()))
    longer = [steady, cut(swapped, slice(0, len(flight) - 100))]
    (found,) = [each for each in check(longer, SETTINGS) if "by the motion, the rotors are" in each.what]
    assert found.contradiction


CONTRADICTED = {
    "velocity in km/h", "velocity down", "world down", "rotors in another order", "hanging", "speeds in rpm",
}  # fmt: skip
ONLY_TOLD = {"twice the mass", "gyroscope late"}


@pytest.mark.parametrize("fault", sorted(CONTRADICTED | ONLY_TOLD))
def test_axes_signs_and_units_are_contradictions_and_clocks_and_numbers_are_not(findings, fault):
    (found, *_) = [finding for finding in findings(fault) if FAULTS[fault][1] in finding.sentence]
    assert found.contradiction == (fault in CONTRADICTED)
    assert found.channels
    assert found.remedy


def test_a_delay_of_the_velocity_is_said_and_contradicts_nothing(flight):
    late = replace(flight, velocity=np.roll(flight.velocity, 3, axis=0))
    assert not any(finding.contradiction for finding in check([late], SETTINGS))


def circling(radius_m, turns_rad_s, late_s, seconds=40.0):
    """Fly a steady circle with the nose ahead; the estimate of its velocity is late."""
    rng = np.random.default_rng(2)
    time = np.arange(0.0, seconds, 0.01)

    def around(values, quarter):
        return np.column_stack([np.cos(values + quarter), np.sin(values + quarter), 0 * values])

    angle = turns_rad_s * time
    heading = np.column_stack([0 * time, 0 * time, np.mod(angle + np.pi, 2 * np.pi) - np.pi])
    velocity = radius_m * turns_rad_s * around(turns_rad_s * (time - late_s), np.pi / 2)
    return Signals(
        time=time,
        vehicle=VEHICLE,
        body_rate=np.column_stack([0 * time, 0 * time, turns_rad_s + 0 * time])
        + 0.1 * rng.standard_normal((len(time), 3)),
        attitude=heading,
        position=radius_m * around(angle, 0.0) + 0.002 * rng.standard_normal((len(time), 3)),
        velocity=velocity + 0.005 * rng.standard_normal((len(time), 3)),
    )


@pytest.mark.parametrize(
    ("radius_m", "turns_rad_s", "late_s"), [(0.008, 2.4, 0.18), (0.5, 2.4, 0.18), (1.0, 5.0, 0.3), (1.0, 8.0, 0.28)]
)
def test_in_a_steady_circle_a_late_estimate_is_no_error_of_axes(radius_m, turns_rad_s, late_s):
    """A circle of 2 cm/s is noise; of faster ones what is late looks rotated, by a quarter of a turn even swapped."""
    findings = check([circling(radius_m, turns_rad_s, late_s)], SETTINGS)
    assert not any(finding.contradiction for finding in findings)
    if radius_m * turns_rad_s < 0.1:
        assert findings == ()


def test_axes_that_are_rotated_are_said_of_a_flight_that_turns_both_ways(flight):
    cos, sin = np.cos(0.5), np.sin(0.5)
    turned = flight.velocity @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    assert "the velocity is rotated by 29 deg about the vertical" in said(replace(flight, velocity=turned))


@pytest.mark.parametrize("late_s", [0.1, 0.2])
@pytest.mark.parametrize("name", ["attitude", "body_rate"])
def test_what_a_filter_takes_of_fast_motion_is_no_error_of_scale(lively, name, late_s):
    values = getattr(lively, name)
    behind = lfilter([1.0], [1 + late_s / PERIOD, -late_s / PERIOD], values - values[0], axis=0) + values[0]
    found = check([replace(lively, **{name: behind})], SETTINGS)
    assert found
    assert not any(finding.contradiction for finding in found)
