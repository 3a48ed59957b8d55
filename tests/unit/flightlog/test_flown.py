"""The part of a log that is flown, told by rotors, height and turning."""

import numpy as np
import pytest

from cpfls_cli.flightlog.crash import Signs
from cpfls_cli.flightlog.flown import find_flown
from cpfls_cli.flightlog.names import BY_HAND

TIME = np.arange(0.0, 40.0, 0.01)


def flown_by(level, height, rate):
    rotors = None if level is None else np.repeat(level[:, None], 4, axis=1)
    turns = None if rate is None else rate[:, None] * [1.0, 0.0, 0.0]
    return find_flown(Signs(time=TIME, rotors=rotors, height=height, body_rate=turns))


def between(begin, end, inside, outside=0.0):
    return np.where((begin <= TIME) & (end > TIME), inside, outside)


def turning(begin, end, size=0.5):
    return between(begin, end, size) * np.sin(3 * TIME)


def test_a_log_that_flies_from_first_to_last_is_not_cut():
    flown = flown_by(np.full(len(TIME), 0.5), 1 + np.sin(TIME), turning(0, 40))
    assert (flown.span_s, flown.reasons, flown.flies) == (None, (), True)


def test_standing_and_idling_rotors_are_cut_with_a_margin():
    level = between(5, 10, 0.1) + between(10, 30, 0.5)
    flown = flown_by(level, None, turning(10, 30))
    assert flown.span_s == (pytest.approx(10.5, abs=0.1), pytest.approx(29.5, abs=0.1))
    assert flown.reasons[0].startswith("the first 10.5 s are cut: ")
    assert flown.reasons[1].endswith(" s are cut: the rotors stand still")


def test_rotors_that_turn_fast_on_the_ground_do_not_fly():
    level, height = between(5, 30, 0.5), between(12, 28, 2.0)
    flown = flown_by(level, height, turning(12, 28))
    assert flown.span_s == (pytest.approx(12.5, abs=0.1), pytest.approx(27.5, abs=0.1))


def test_a_flight_that_comes_down_to_the_height_of_its_ground_is_one():
    height = between(6, 16, 2.0) + between(22, 30, 2.0)
    flown = flown_by(between(5, 31, 0.5), height, turning(5, 31))
    assert flown.span_s == (pytest.approx(6.5, abs=0.1), pytest.approx(29.5, abs=0.1))


def test_a_climb_begins_and_a_descent_ends_on_the_ground():
    """From 5 s and to 35 s at 2 m/s, which is within a tenth of the highest for a second and more."""
    height = np.clip(np.minimum(2 * (TIME - 5), 2 * (35 - TIME)), 0.0, None)
    flown = flown_by(between(2, 36, 0.5), height, turning(5, 35))
    assert flown.span_s == (pytest.approx(5.5, abs=0.2), pytest.approx(34.5, abs=0.2))


def test_a_descent_that_is_cut_short_leaves_what_follows_on_the_ground():
    height = np.interp(TIME, [3, 5, 11, 12.5, 26, 27, 34, 35], [0, 2, 2, 0, 0, 2, 2, 0])
    flown = flown_by(between(3, 12, 0.5) + between(20, 36, 0.5), height, turning(3, 12) + turning(26, 35))
    assert [tuple(map(round, own)) for own in flown.stretches_s] == [(4, 11), (27, 34)]


@pytest.mark.parametrize("period", [1.0, 2.0])
def test_a_flight_that_is_logged_once_a_second_or_less_is_found(period):
    time = np.arange(0.0, 120.0, period)
    flies = (time > 5) & (time < 110)
    rotors, height = np.repeat(0.5 * flies[:, None], 4, axis=1), np.where(flies, 5 + np.sin(time), 0.0)
    rate = 0.3 * np.sin(2 * time)[:, None] * [1.0, 0.0, 0.0]
    found = find_flown(Signs(time=time, rotors=rotors, height=height, body_rate=rate))
    assert found.span_s == (pytest.approx(6, abs=2.1), pytest.approx(109, abs=2.1))
    assert found.ended == ""


def test_idling_in_flips_is_part_of_the_flight():
    level = between(5, 35, 0.5) - between(15, 20, 0.42)
    lively = flown_by(level, None, turning(5, 35, 6.0))
    assert lively.span_s == (pytest.approx(5.5, abs=0.1), pytest.approx(34.5, abs=0.1))
    quiet = flown_by(level, None, turning(5, 15, 6.0) + turning(20, 35, 6.0))
    assert quiet.span_s == (pytest.approx(20.5, abs=0.6), pytest.approx(34.5, abs=0.1))
    assert any("it also flies at" in reason for reason in quiet.reasons)


def test_height_alone_tells_a_flight():
    flown = flown_by(None, between(10, 30, 1.0), turning(10, 30))
    assert flown.span_s == (pytest.approx(10.5, abs=0.1), pytest.approx(29.5, abs=0.1))


@pytest.mark.parametrize(
    ("level", "height", "rate", "reason"),
    [
        (0 * TIME, None, 0 * TIME, "no flight in it: the rotors stand still throughout"),
        (
            0 * TIME,
            None,
            turning(0, 40),
            "no flight in it: the rotors stand still throughout, and it is turned by hand",
        ),
        (0 * TIME + 0.3, 0 * TIME, 0 * TIME, "no flight in it: the vehicle neither turns nor moves"),
        (
            None,
            None,
            None,
            "no rotors, no height and no rates are recognised, so flight cannot be distinguished from standing: "
            f"{BY_HAND}",
        ),
    ],
)
def test_what_does_not_fly_is_said_to(level, height, rate, reason):
    flown = flown_by(level, height, rate)
    assert (flown.flies, flown.reasons) == (False, (reason,))


def test_a_short_idle_on_the_ground_does_not_fly():
    time, noise = TIME[:500], np.random.default_rng(1).standard_normal((500, 3))
    found = find_flown(
        Signs(
            time=time,
            rotors=np.full((500, 4), 0.08),
            height=0.01 * time,
            body_rate=0.03 * noise,
            upright=np.full(500, 0.999),
            force=9.81 * (np.array([0.04, 0.0, -1.0]) + 0.02 * noise),
        )
    )
    assert (found.flies, found.reasons) == (False, ("no flight in it: the vehicle neither turns nor moves",))


@pytest.mark.parametrize("turns_rad_s", [4.0, 4 * np.pi])
def test_a_stand_feels_the_weight_turn_and_a_flight_does_not(turns_rad_s):
    """Also where it swings at 2 Hz, of which a mean over half a second holds nothing."""
    lean = 0.2 * np.sin(turns_rad_s * TIME)

    def flown(side):
        signs = Signs(
            time=TIME,
            rotors=np.full((len(TIME), 4), 0.4),
            body_rate=np.gradient(lean, 0.01)[:, None] * [0.0, 1.0, 0.0],
            force=np.column_stack([side, 0 * TIME, np.cos(lean)]),
        )
        return find_flown(signs)

    stand = flown(-np.sin(lean))
    assert not stand.flies
    assert stand.reasons == ("no flight in it: the weight turns through it as it turns, as on a test stand",)
    # Drag follows speed, which the lean makes, late; an acceleration of the world has the other sign.
    assert flown(0.05 * np.cos(turns_rad_s * TIME)).flies
    assert flown(np.sin(lean)).flies


def test_vibration_on_the_ground_is_no_thrust():
    rng = np.random.default_rng(2)
    level = between(18, 32, 0.5, 0.22)
    rate = np.column_stack([turning(18, 32, 0.6), 0 * TIME, 0 * TIME])
    force = np.array([0.0, 0.0, 1.0]) + rng.standard_normal((len(TIME), 3))
    flown = find_flown(Signs(time=TIME, rotors=np.repeat(level[:, None], 4, axis=1), body_rate=rate, force=force))
    assert flown.span_s == (pytest.approx(18.0, abs=1.0), pytest.approx(32.0, abs=1.0))


@pytest.mark.parametrize("shares", [(1.42, 1.42, 0.58, 0.58), (1.4, 0.6, 1.4, 0.6), (1.9, 0.9, 0.9, 0.9)])
def test_a_trimmed_vehicle_and_one_with_a_weak_rotor_fly(shares):
    """They feel their weight along the rotors, however unlike these are."""
    rotors = np.full((len(TIME), 4), 0.5) * shares
    rate = np.column_stack([turning(0, 40), 0 * TIME, 0 * TIME])
    flown = find_flown(Signs(time=TIME, rotors=rotors, body_rate=rate, force=np.tile([0.0, 0.0, 1.0], (len(TIME), 1))))
    assert (flown.flies, flown.span_s, flown.ended) == (True, None, "")


def test_a_quadrotor_without_one_rotor_spins_or_is_held():
    rotors = np.full((len(TIME), 4), 0.4) * [1, 1, 1, 0.01]
    wobbles = 0.3 * np.sin(9 * TIME)[:, None] * [1.0, 1.0, 0.0]
    held = find_flown(Signs(time=TIME, rotors=rotors, body_rate=0.1 * wobbles))
    assert held.reasons == ("no flight in it: rotor 4 hardly works, and it does not spin, as on a test stand",)
    spinning = wobbles + np.cumsum(np.where(TIME < 38, 0.002, -0.04))[:, None] * [0, 0, 1.0]
    assert find_flown(Signs(time=TIME, rotors=rotors, body_rate=spinning)).flies


def test_what_feels_no_thrust_is_held():
    """Rotors that work up to six times as much as they did are felt in the air, and not by what is tied down."""
    squares = 0.2 + 0.14 * np.sin(0.5 * TIME)
    rate = np.random.default_rng(4).standard_normal((len(TIME), 3))

    def flown(felt):
        force = felt[:, None] * [0.0, 0.0, 1.0] + 0.02 * rate
        rotors = np.repeat(np.sqrt(squares)[:, None], 4, axis=1)
        return find_flown(Signs(time=TIME, rotors=rotors, body_rate=rate, force=force))

    held = flown(1.0 + 0 * TIME)
    assert held.reasons == ("no flight in it: what it feels does not grow with its thrust, as on a test stand",)
    assert flown(squares / squares.mean()).flies


def test_what_turns_itself_over_on_the_ground_does_not_fly():
    """Two rotors at a time, in either direction."""
    works = np.where((TIME % 4 < 2)[:, None], [0.6, 0.6, 0.0, 0.0], [0.0, 0.0, 0.6, 0.6])
    rate = 3.0 * np.sin(2 * TIME)[:, None] * [1.0, 0.3, 0.1]
    found = find_flown(Signs(time=TIME, rotors=works, body_rate=rate))
    why = "no flight in it: no more than two of its four rotors work at a time, as on a test stand"
    assert (found.flies, found.reasons) == (False, (why,))
    assert find_flown(Signs(time=TIME, rotors=np.maximum(works, 0.1), body_rate=rate)).flies


@pytest.mark.parametrize("lifts", [True, False])
def test_a_simulated_hover_whose_gyroscope_reads_next_to_nothing_flies(lifts):
    height = 5 * np.clip((TIME - 5) / 5, 0, 1) * lifts
    force = np.column_stack([0 * TIME, 0 * TIME, 1 + 0.1 * lifts * np.sin(TIME)])
    rate = 1e-4 * np.sin(TIME)[:, None] * [1.0, 1.0, 1.0]
    rotors = np.repeat(between(3, 40, 0.5)[:, None], 4, axis=1)
    assert find_flown(Signs(time=TIME, rotors=rotors, body_rate=rate, height=height, force=force)).flies == lifts


def test_idling_rotors_that_hardly_shake_the_vehicle_do_not_fly():
    flown = flown_by(between(5, 35, 0.1), None, turning(5, 35, 0.015))
    assert (flown.flies, flown.reasons) == (False, ("no flight in it: the vehicle neither turns nor moves",))


def test_a_height_that_hardly_changes_is_one_without_other_signs_too():
    assert flown_by(None, 2.0 + 0.03 * np.sin(TIME), None).flies
    assert flown_by(None, 0 * TIME, None).reasons == ("no flight in it: the vehicle neither turns nor moves",)


def test_a_cut_throttle_in_free_fall_is_part_of_the_flight():
    level = between(5, 35, 0.5) - between(15, 17, 0.5)
    falls = between(15.1, 17, -0.95)
    signs = Signs(
        time=TIME,
        rotors=np.repeat(level[:, None], 4, axis=1),
        body_rate=(turning(5, 15, 3.0) + turning(17, 35, 3.0))[:, None] * [1.0, 0.0, 0.0],
        force=(1 + falls)[:, None] * [0.0, 0.0, 1.0],
    )
    flown = find_flown(signs)
    assert flown.moments == ()
    assert len(flown.stretches_s) == 1


def test_rotors_that_rise_on_the_ground_do_not_fly_before_it_moves():
    flown = flown_by(between(5, 35, 0.5), None, turning(20, 35))
    assert flown.stretches_s[0][0] == pytest.approx(20.5, abs=0.4)


def test_who_mostly_climbs_hovers_below_the_usual_level():
    """Rotors at three times the level of hover in punch-outs; at the end the vehicle hovers and hardly turns."""
    climbs = (TIME > 3) & (TIME < 30) & (TIME % 4 < 1.5)
    level = np.where(climbs, 0.8, between(2, 38, 0.26))
    rate = np.column_stack([turning(2, 30, 4.0) + turning(30, 38, 0.15), 0 * TIME, 0 * TIME])
    force = np.column_stack([0 * TIME, 0 * TIME, np.where(climbs, 9.4, 1.0)])
    rotors = np.repeat(level[:, None], 4, axis=1)
    flown = find_flown(Signs(time=TIME, rotors=rotors, body_rate=rate, force=force))
    assert flown.span_s == (pytest.approx(2.5, abs=0.1), pytest.approx(37.5, abs=0.1))


@pytest.mark.parametrize("held", [False, True])
def test_a_sensor_off_the_centre_of_what_vibrates_shows_no_test_stand(held):
    """A vibration of 8 Hz turns with the force that its lever makes; on a stand the weight turns slowly too."""
    clock = np.arange(0.0, 30.0, 0.04)
    rng = np.random.default_rng(3)
    shaking, large = 2 * np.pi * 8.0, 0.2 if held else 0.06
    leans = large * np.sin(1.3 * clock)
    turns = np.sin(shaking * clock) + 1.3 * large * np.cos(1.3 * clock)
    rate = np.column_stack([turns, 0 * clock, 0 * clock])
    lever = -1.2e-3 * shaking * np.cos(shaking * clock)
    force = np.column_stack([0 * clock, lever + (np.sin(leans) if held else 0.0), 1.0 + 0 * clock])
    force += 1e-4 * rng.standard_normal(force.shape)
    rotors = 0.5 + 0.02 * rng.standard_normal((len(clock), 4))
    flown = find_flown(Signs(time=clock, rotors=rotors, body_rate=rate, force=force))
    assert flown.flies != held
    assert ("as on a test stand" in "".join(flown.reasons)) == held


def test_what_is_cut_is_said_of_what_does_not_fly():
    flown = flown_by(between(5, 14, 0.5) + between(20, 35, 0.5), None, turning(5, 14) + turning(20, 35))
    assert [reason.split(":")[0] for reason in flown.reasons] == [
        "the first 5.5 s are cut",
        "the last 5.5 s are cut",
        "it also flies at 5.0 to 14.0 s; import.crop_s takes one stretch, the longest",
    ]
