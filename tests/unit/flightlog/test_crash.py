"""What ends a flight before its time is found, cut and said; what looks alike and is flight stays."""

import re

import numpy as np
import pytest

from cpfls_cli.flightlog.crash import Resting, Signs, ended_early, upright_of
from cpfls_cli.flightlog.flown import find_flown, rotor_shares
from tests.builders import ended_flights as ended
from tests.builders.topic_logs import ardupilot, proposed
from tests.builders.unknown_logs import flight

HIGH, WEIGHT = np.array([0.0, 0.0, 30.0]), np.array([0.0, 0.0, 9.81])
ALL = ("height", "upright", "force")


@pytest.fixture(scope="module")
def own():
    made = flight(ended.SECONDS)
    made.position = made.position + HIGH
    return made


def flown(log, known=ALL):
    signs = {
        "height": log.position[:, 2],
        "upright": upright_of(log.angles, None, "wxyz"),
        "force": log.specific_force / 9.81,
    }
    shares = rotor_shares(log.speed, shares=False)
    return find_flown(Signs(time=log.time, rotors=shares, body_rate=log.rate, **{name: signs[name] for name in known}))


@pytest.mark.parametrize("known", [ALL, ("force",), ("upright",), ()])
@pytest.mark.parametrize(
    ("ends", "without_force", "with_force"),
    [
        (ended.hits, "loss of control at ", "impact at "),
        (ended.hits_with_rotors_that_drop, "loss of control at ", "impact at "),
        (ended.tumbles, "loss of control at ", "loss of control at "),
        (ended.held, "it rests on something, with its rotors on", "it rests on something, with its rotors on"),
    ],
)
def test_the_part_before_a_crash_is_used(own, ends, without_force, with_force, known):
    found = flown(ends(own), known)
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS, abs=0.3))
    assert (with_force if "force" in known else without_force) in found.ended
    assert found.used == "the 40 s before it are used"
    assert found.reasons == ()


@pytest.mark.parametrize(
    ("ends", "known", "after", "within", "said"),
    [
        (ended.gives_way, ALL, 0.6, 0.2, r"loss of control at {:.1f} s, impact at 43\.0 s"),
        (ended.rocks_on_the_ground, ("force",), 0.0, 0.1, r"impact at 40\.0 s"),
        (ended.leans_on_a_wall, ALL, 0.0, 0.5, ".*it rests on something, with its rotors on.*"),
        (ended.falls_and_hits, ALL, 0.0, 0.1, r"it falls freely from 40\.0 s on, impact at 40\.6 s"),
    ],
    ids=[
        "rotors at their limit no longer hold it",
        "it rocks on the ground",
        "it leans high above the ground",
        "a fall",
    ],
)
def test_a_flight_ends_where_its_crash_begins(own, ends, known, after, within, said):
    found = flown(ends(own), known)
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS + after, abs=within))
    assert re.fullmatch(said.format(found.span_s[1] + 0.02), found.ended)


@pytest.mark.parametrize("known", [ALL, ("force",), ("upright",)])
def test_a_vehicle_on_its_back_does_not_fly_whatever_its_rotors_do(own, known):
    found = flown(ended.turns_over(own), known)
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS + 0.5, abs=0.5))
    assert found.ended


def test_a_wreck_that_flies_again_later_has_lain_on_its_back(own):
    found = flown(ended.joined(ended.rocks_on_its_back(own), flight(20.0, seed=4)), ("force",))
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS, abs=0.3))
    assert "impact at " in found.ended


@pytest.mark.parametrize("bias", [-0.6, -1.0])
def test_an_accelerometer_that_reads_too_little_does_not_turn_a_flight_over(own, bias):
    log = ended.rocks_on_its_back(own, 15.0)
    log.specific_force = log.specific_force + np.array([0.0, 0.0, bias])
    found = flown(log, ("force",))
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS, abs=0.3))
    assert "impact at " in found.ended


@pytest.mark.parametrize("known", [ALL, ("force",)])
def test_a_crash_after_a_few_seconds_of_flight(known):
    """No rotor pulls: what feels its weight from above lies on its back, however it rocks."""
    found = flown(ended.rocks_on_its_back(flight(4.0)), known)
    assert found.span_s == (0.0, pytest.approx(4.0, abs=0.2))
    assert re.fullmatch(r"loss of control at 4\.\d s, impact at 5\.0 s", found.ended)


def test_a_log_that_ends_upside_down_after_a_few_seconds_of_flight():
    found = flown(ended.rocks_on_its_back(flight(4.0), 0.5))
    assert re.fullmatch(r"loss of control at 4\.\d s, impact at 5\.0 s", found.ended)
    assert flown(ended.rocks_on_its_back(flight(4.0), 0.5), ("force",)).ended == ""
    # What turns over and has hit nothing may be in a flip, whose rotors so short a log does not explain.
    over = ended.then(flight(4.0), 1.0, rate=-16.0, felt=(0.0, 0.0, 3.0), rotors=1.0)
    assert np.cos(over.angles[-1, 0]) < 0
    assert flown(over).ended == ""


@pytest.mark.parametrize("known", [("height", "upright"), ("upright",)])
def test_a_log_that_ends_upside_down_right_after_its_rotors_stopped(known):
    over = ended.then(flight(6.0), 0.5, rate=-12.0, rotors=1.0)
    assert re.fullmatch(r"loss of control at [56]\.\d s", flown(ended.then(over, 0.3, rate=-12.0), known).ended)
    # Long afterwards it has been carried away.
    assert flown(ended.then(over, 3.0, rate=-12.0), known).ended == ""


def test_a_vehicle_that_hangs_on_one_of_four_rotors_throughout_does_not_fly():
    time, noise = np.arange(0.0, 20.0, 0.02), np.random.default_rng(0).standard_normal((1000, 3))
    rotors, force = np.tile([0.9, 0.1, 0.1, 0.1], (1000, 1)), [0.6, 0.0, 0.8] + 0.01 * noise
    assert not find_flown(Signs(time=time, rotors=rotors, body_rate=0.02 * noise, force=force)).flies


def test_a_hop_says_how_it_ended():
    found = flown(ended.joined(ended.then(flight(0.1), 6.0), ended.rocks_on_its_back(flight(1.0))), ("force",))
    assert not found.flies
    assert found.reasons[0].startswith("flies for only ")
    assert found.reasons[0].endswith("; from 8.1 s on it rests on something, with its rotors on")
    # Nor are two, one after another, that are landed.
    found = flown(ended.joined(ended.then(flight(1.0), 10.0), ended.then(flight(1.5), 10.0)), ())
    assert not found.flies
    assert found.reasons[0].startswith("flies for only ")


@pytest.mark.parametrize("known", [ALL, ("force",), ("height",)])
def test_rotors_that_stop_in_the_air_are_no_landing(own, known):
    found = flown(ended.stops_in_the_air(own), known)
    hit = ", impact at 41.2 s" if "force" in known else ""
    assert found.ended == f"the rotors stop in the air at 40.0 s{hit}"
    assert flown(ended.then(ended.then(own, 0.04, rate=1.0, felt=(0.0, 0.0, 40.0)), 5.0), known).ended == ""


def test_a_fall_that_no_flight_has_is_a_loss_of_control(own):
    """Rotors at full all the while, and a landing at any speed is none."""
    found = flown(ended.then(own, 8.0, rate=2.0, rotors=1.6, felt=(0.0, 0.0, 4.0), falls=10.0), ("height",))
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS + 2.5, abs=0.3))
    assert found.ended.startswith("loss of control at 42.")
    brief = ended.then(own, 4.0, rate=2.0, rotors=1.6, felt=(0.0, 0.0, 4.0), falls=10.0)
    assert "loss of control" not in flown(brief, ("height",)).ended


def test_a_jolt_at_the_moment_of_coming_to_rest_is_an_impact():
    """It lies from the sample on that jolts, right after it turned as it never did."""
    time = np.arange(0.0, 50.0, 0.02)
    turns = np.where((time > 39.9) & (time < 40.0), 8.0, 0.3 * np.sin(time) * (time < 39.9))
    size = np.where((time >= 40.0) & (time < 40.07), 6.0, 1.0)
    signs = Signs(time=time, body_rate=turns[:, None] * [1.0, 0, 0], force=size[:, None] * [0, 0, 1.0])
    rests = np.asarray(time >= 40.0)
    ended_by = ended_early(signs, Resting(rests, rests), (0, int(rests.argmax())))
    assert {what: time[at] for what, at in ended_by.items()} == {"impact": pytest.approx(39.9, abs=0.05)}


def test_of_a_crash_amid_a_log_the_longest_stretch_is_used(own):
    found = flown(ended.joined(ended.hits(flight(20.0)), own))
    assert found.span_s == (pytest.approx(29.0, abs=0.7), pytest.approx(68.35, abs=0.1))
    assert found.cut[0] == "impact at 20.0 s; 29.0 to 68.3 s are used"


@pytest.mark.parametrize("known", [ALL, ("force",), ("upright",), ()])
def test_flips_are_flight_also_where_the_log_ends_in_them(own, known):
    for log in (ended.flips(own), ended.joined(own, ended.flips(flight(12.0)))):
        assert flown(log, known).span_s is None


def test_what_turns_over_near_the_ground_and_never_leaves_it_again_has_crashed(own):
    found = flown(ended.rolls_on_the_ground(own))
    assert found.span_s == (0.0, pytest.approx(ended.SECONDS, abs=0.5))
    assert found.ended.startswith("loss of control at 40.0 s")
    # High above the ground it flies.
    assert flown(ended.rolls_on_the_ground(own, height=4.0)).span_s is None


def test_a_push_before_the_end_of_a_log_that_is_flown_out_of_is_no_loss_of_control(own):
    """Such as the wake of another vehicle: its rotors do not turn it, and it flies on as before."""
    pushed = ended.changed(own, rate=own.rate.copy(), angles=own.angles.copy())
    begin = own.time[-1] - 1.3
    turn = (own.time >= begin) & (own.time < begin + 0.4)
    phase = 2 * np.pi * (own.time[turn] - begin) / 0.4
    pushed.rate[turn, 0] += 12.0 * np.sin(phase)
    pushed.angles[turn, 0] += 12.0 * 0.4 / (2 * np.pi) * (1 - np.cos(phase))
    assert flown(pushed, ("height", "upright")).ended == ""
    # What does not move at all has come down.
    lies = ended.changed(pushed, rate=np.where((own.time > begin + 0.6)[:, None], 0.0, pushed.rate))
    assert flown(lies, ("height", "upright")).ended.startswith("loss of control at ")
    still = own.time < begin + 0.35
    for name in ("time", "rate", "angles", "position", "specific_force", "speed"):
        setattr(pushed, name, getattr(pushed, name)[still])
    assert flown(pushed, ("height", "upright")).ended.startswith("loss of control at ")


def test_a_vehicle_that_is_carried_home_by_hand_is_said_to(own):
    found = flown(ended.carried(own))
    assert found.reasons == ("the last 18.5 s are cut: the rotors stand still or idle while it is moved by hand",)


@pytest.mark.parametrize("known", [ALL, ("force",), ()])
def test_what_only_shakes_on_a_bench_does_not_fly(own, known):
    rng = np.random.default_rng(1)
    rate, angles, force = np.array([[[0.1]], [[0.001]], [[0.5]]]) * rng.standard_normal((3, *own.rate.shape))
    bench = ended.changed(own, rate=rate, angles=angles, position=0 * own.position, specific_force=WEIGHT + force)
    found = flown(bench, known)
    assert (found.flies, found.reasons) == (False, ("no flight in it: the vehicle neither turns nor moves",))


def test_height_of_an_autopilot_that_counts_downward(own):
    """Without an accelerometer only the height shows that rotors stop in the air."""
    topics = ardupilot(ended.stops_in_the_air(own))
    topics = {name: fields for name, fields in topics.items() if not name.startswith("ESC")}
    topics["IMU"] = {name: values for name, values in topics["IMU"].items() if not name.startswith("Acc")}
    functions = {f"SERVO{output}_FUNCTION": 28.0 + output for output in range(5, 9)}
    found = proposed(topics, "ArduCopter 4.3.0", functions).logs[0].recognition.flown
    assert found.ended.startswith("the rotors stop in the air at ")


@pytest.mark.parametrize("known", [("height",), ("force",), ("upright",)])
def test_dead_rates_deny_no_flight_that_leans_is_pushed_or_climbs(own, known):
    climbs = own.position + np.outer(own.time, [0.0, 0.0, 1.0])
    felt = own.specific_force * np.linspace(0.6, 1.4, len(own.time))[:, None]
    assert flown(ended.changed(own, position=climbs, rate=0.001 * own.rate, specific_force=felt), known).flies


def test_an_estimate_of_height_that_drifts_on_the_ground_is_no_flight(own):
    rng = np.random.default_rng(1)
    rate, angles, force = np.array([[[0.006]], [[0.001]], [[0.05]]]) * rng.standard_normal((3, *own.rate.shape))
    rate += 0.01 * np.sin(own.time)[:, None]
    drifts = np.outer(0.4 * np.sin(0.2 * own.time), [0.0, 0.0, 1.0])
    found = flown(ended.changed(own, rate=rate, angles=angles, specific_force=WEIGHT + force, position=drifts), ALL)
    assert (found.flies, found.reasons) == (False, ("no flight in it: the vehicle neither turns nor moves",))


def test_a_climb_that_neither_turns_nor_leans_is_a_flight(own):
    rate = 0.006 * np.random.default_rng(1).standard_normal(own.rate.shape)
    assert flown(ended.changed(own, rate=rate, angles=0 * own.angles)).flies


def test_a_hover_without_gyroscope_that_leans_is_a_flight(own):
    signs = Signs(
        time=own.time,
        rotors=rotor_shares(own.speed, shares=False),
        height=0.05 * np.sin(own.time),
        upright=upright_of(own.angles, None, "wxyz"),
    )
    assert find_flown(signs).flies


def test_a_rotor_that_weakens_high_up_rests_on_nothing(own):
    calm = ended.then(own, 12.0, roll=own.angles[-1, 0], rotors=(1.3, 0.9, 0.9, 0.9))
    calm.position[:, 2] *= np.minimum(calm.time / 5.0, 1.0)
    assert "rests" not in flown(calm, ("height", "upright")).ended


@pytest.mark.parametrize("known", [("force",), ("upright",), ()])
def test_a_flip_before_landing_is_no_crash(own, known):
    assert flown(ended.then(ended.joined(own, ended.flips(flight(7.0))), 5.0, roll=0.0), known).ended == ""


def test_an_attitude_that_turns_over_while_weight_stays_is_no_flight(own):
    bench = ended.changed(own, angles=own.angles.copy(), rate=own.rate.copy(), specific_force=WEIGHT + 0 * own.rate)
    bench.angles[:, 0], bench.rate[:, 0] = 0.6 * own.time, 0.6
    found = flown(bench, ("force", "upright"))
    assert not found.flies
    assert found.reasons[0].startswith("no flight in it: by its attitude it lies on its back for seconds")


def test_a_long_turn_pushed_along_its_side_is_no_rest(own):
    """Air that is as strong as the weight, as a dive has it, while the vehicle turns slowly all the time."""
    inside = ((own.time > 15) & (own.time < 20))[:, None]
    dives = ended.changed(own, specific_force=np.where(inside, [9.0, 1.0, 0.0], own.specific_force))
    dives.rate = np.where(inside, [0.35, 0.0, 0.3], own.rate)
    assert flown(dives, ("force",)).ended == ""
    dives.rate = np.where(inside, np.median(own.rate, axis=0), own.rate)
    assert "rests on something" in flown(dives, ("force",)).ended
