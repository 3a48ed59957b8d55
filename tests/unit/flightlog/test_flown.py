"""The part of a log that is flown, told by rotors, height and turning."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.flightlog.crash import Signs
from cpfls_cli.flightlog.flown import find_flown
from cpfls_cli.flightlog.names import BY_HAND

TIME = np.arange(0.0, 40.0, 0.01)


def flown_by(level, height, rate, force=None):
    """What flies by rotors that are alike, height, turning about x and force, in weights along z or three of them."""
    rotors = None if level is None else np.repeat(level[:, None], 4, axis=1)
    turns = None if rate is None else rate[:, None] * [1.0, 0.0, 0.0]
    felt = force if force is None or force.ndim == 2 else force[:, None] * [0.0, 0.0, 1.0]
    return find_flown(Signs(time=TIME, rotors=rotors, height=height, body_rate=turns, force=felt))


def between(begin, end, inside, outside=0.0):
    return np.where((begin <= TIME) & (end > TIME), inside, outside)


def turning(begin, end, size=0.5):
    return between(begin, end, size) * np.sin(3 * TIME)


def test_a_log_that_flies_from_first_to_last_is_not_cut():
    flown = flown_by(np.full(len(TIME), 0.5), 1 + np.sin(TIME), turning(0, 40))
    assert (flown.span_s, flown.reasons, flown.flies) == (None, (), True)


def test_standing_and_idling_rotors_are_cut_with_a_margin():
    flown = flown_by(between(5, 10, 0.1) + between(10, 30, 0.5), None, turning(10, 30))
    assert flown.span_s == (pytest.approx(10.5, abs=0.1), pytest.approx(29.5, abs=0.1))
    assert flown.reasons[0].startswith("the first 10.5 s are cut: ")
    assert flown.reasons[1].endswith(" s are cut: the rotors stand still or idle")


def test_rotors_that_turn_fast_on_the_ground_do_not_fly():
    level, height = between(5, 30, 0.5), between(12, 28, 2.0)
    flown = flown_by(level, height, turning(12, 28))
    assert flown.span_s == (pytest.approx(12.5, abs=0.1), pytest.approx(27.5, abs=0.1))
    assert flown.air_s == ((pytest.approx(12.0, abs=0.1), pytest.approx(28.0, abs=0.1)),)


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


def test_height_alone_shows_a_flight():
    flown = flown_by(None, between(10, 30, 1.0), turning(10, 30))
    assert flown.span_s == (pytest.approx(10.5, abs=0.1), pytest.approx(29.5, abs=0.1))


@pytest.mark.parametrize(
    ("level", "height", "rate", "reason"),
    [
        (0 * TIME, None, 0 * TIME, "no flight in it: the rotors stand still or idle throughout"),
        (
            0 * TIME,
            None,
            turning(0, 40),
            "no flight in it: the rotors stand still or idle throughout, and it is turned by hand",
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
    force = np.array([0.0, 0.0, 1.0]) + rng.standard_normal((len(TIME), 3))
    flown = flown_by(level, None, turning(18, 32, 0.6), force)
    assert flown.span_s == (pytest.approx(18.0, abs=1.0), pytest.approx(32.0, abs=1.0))


@pytest.mark.parametrize("shares", [(1.42, 1.42, 0.58, 0.58), (1.4, 0.6, 1.4, 0.6), (1.9, 0.9, 0.9, 0.9)])
def test_a_trimmed_vehicle_and_one_with_a_weak_rotor_fly(shares):
    """They feel their weight along the rotors, however unlike these are."""
    rotors = np.full((len(TIME), 4), 0.5) * shares
    rate = np.column_stack([turning(0, 40), 0 * TIME, 0 * TIME])
    flown = find_flown(Signs(time=TIME, rotors=rotors, body_rate=rate, force=np.tile([0.0, 0.0, 1.0], (len(TIME), 1))))
    assert (flown.flies, flown.span_s, flown.ended) == (True, None, "")


@pytest.mark.parametrize("shares", [(1, 1, 1, 0.01), (1.43, 1.38, 0.72, 0.47), (1.4, 0.6, 1.4, 0.3)])
def test_a_quadrotor_whose_rotors_pull_unevenly_spins_or_is_held(shares):
    rotors = np.full((len(TIME), 4), 0.4) * shares
    wobbles = 0.3 * np.sin(9 * TIME)[:, None] * [1.0, 1.0, 0.0]
    held = find_flown(Signs(time=TIME, rotors=rotors, body_rate=0.1 * wobbles))
    assert held.reasons == (
        "no flight in it: rotor 4 works far less than the others, and it does not spin, as on a test stand",
    )
    # One that works twice as much as the others leaves the sums of any two nearly alike.
    calm = 0.15 * np.sin(3 * TIME)[:, None] * [1.0, 0.0, 0.0]
    assert find_flown(Signs(time=TIME, rotors=0.4 + 0 * rotors + [0.4, 0, 0, 0], body_rate=calm)).flies
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
    flown = flown_by(level, None, turning(5, 15, 3.0) + turning(17, 35, 3.0), 1 + between(15.1, 17, -0.95))
    assert flown.moments == ()
    assert len(flown.stretches_s) == 1


def test_rotors_that_rise_on_the_ground_do_not_fly_before_it_moves():
    assert flown_by(between(5, 35, 0.5), None, turning(20, 35)).stretches_s[0][0] == pytest.approx(20.5, abs=0.4)


def test_who_mostly_climbs_hovers_below_the_usual_level():
    """Rotors at three times the level of hover in punch-outs; at the end the vehicle hovers and hardly turns."""
    climbs = (TIME > 3) & (TIME < 30) & (TIME % 4 < 1.5)
    level = np.where(climbs, 0.8, between(2, 38, 0.26))
    flown = flown_by(level, None, turning(2, 30, 4.0) + turning(30, 38, 0.15), np.where(climbs, 9.4, 1.0))
    assert flown.span_s == (pytest.approx(2.5, abs=0.1), pytest.approx(37.5, abs=0.1))


def test_who_climbs_fast_for_most_of_a_flight_hovers_below_what_the_climb_takes():
    """At full throttle it feels little more than its weight, against the air; then it flips, and hovers."""
    times = [0, 2, 3, 4, 6, 20, 20.5, 22.5, 23, 38, 38.5]
    level = np.interp(TIME, times, [0, 0, 0.3, 0.36, 0.6, 1.0, 0.1, 0.1, 0.3, 0.28, 0])
    force = np.interp(TIME, [0, 3, 3.5, 20, 20.5, 22.5, 23], [1, 1, 1.35, 1.25, 0.2, 0.2, 1.0])
    wobbles = between(4, 37, 0.1) * np.sin(2 * TIME)
    rate = turning(3, 38.2, 0.3) + between(20.5, 22.5, 8.0)
    flown = flown_by(level * (1 + wobbles), None, rate, force * (1 + 2 * wobbles))
    assert flown.span_s == (pytest.approx(3.5, abs=0.3), pytest.approx(37.7, abs=0.3))


def test_what_idles_for_long_under_an_accelerometer_that_reads_too_much_stands():
    level = np.interp(TIME, [0, 1, 18, 19, 36, 36.5, 39, 40], [0, 0.2, 0.2, 0.5, 0.5, 0.2, 0.2, 0])
    wobbles = between(19, 36, 0.1) * np.sin(2 * TIME)
    flown = flown_by(level * (1 + wobbles), None, turning(18, 36.5, 0.4), 1.2 * (1 + 2 * wobbles))
    assert flown.span_s == (pytest.approx(18.5, abs=0.4), pytest.approx(36.2, abs=0.4))


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


UP = np.array([0.0, 0.0, 1.0])


def inside(time, begin, end, value, outside=0.0):
    """A value from one time to another, numbers or rows."""
    during = (time >= begin) & (time < end)
    return np.where(during if np.size(value) in (1, len(time)) else during[:, None], value, outside)


def signs_of(time, *, rotors=0.5, rate=0.3, rolls=0.0, noise=0.0, force=None, shakes=0.05, lean=None, height=None):
    """Rotors, size of gentle turning and a roll, rad/s, force in weights, lean, height; noise of both sensors."""
    rng, still = np.random.default_rng(0), 0 * time
    waves = np.column_stack([np.sin(2 * time), np.cos(1.5 * time), 0.2 * np.sin(time)])
    turns = waves * np.reshape(rate, (-1, 1)) + np.outer(still + rolls, [1.0, 0.0, 0.0])
    return Signs(
        time=time,
        rotors=None
        if rotors is None
        else np.broadcast_to(np.reshape(rotors, (-1, 1 if np.ndim(rotors) < 2 else 4)), (len(time), 4)),
        height=None if height is None else still + height,
        body_rate=turns + np.reshape(noise, (-1, 1)) * rng.standard_normal(waves.shape),
        upright=None if lean is None else np.cos(still + lean),
        force=None if force is None else force + shakes * rng.standard_normal(waves.shape),
    )


def slow_climb(noise, lean=None):
    """Ten metres in a minute, in a simulation: nothing but its height shows that it flies."""

    def made(time):
        s = time / 60
        height = 10 + 10 * (6 * s**5 - 15 * s**4 + 10 * s**3)
        felt = 1 + np.gradient(np.gradient(height, time), time) / 9.81
        leans = None if lean is None else lean * np.sin(time / 5)
        level = np.sqrt(felt) / 2
        return {"rotors": level, "rate": 0, "noise": noise, "height": height, "lean": leans} | calm(felt)

    return made


def calm(felt):
    return {"force": np.outer(felt, UP), "shakes": 0.002}


def hover(noise):
    """A few centimetres and hundredths of a rad about one place."""

    def made(time):
        force = UP + 0.05 * np.outer(np.sin(0.3 * time), [1, 0, 0])
        slow = {"height": 1 + 0.05 * np.sin(0.3 * time), "lean": 0.02 + 0.03 * np.sin(0.2 * time)}
        return {"rate": 0, "noise": noise, "force": force, "shakes": 0.01} | slow

    return made


def acrobatics(*known, idle=0.06, noise=0.0, hand=0.0):
    """Two flights, between which it stands for 20 s."""

    def made(time):
        flies = inside(time, 3, 30, 1) + inside(time, 50, 77, 1) > 0
        force = np.outer(np.where(flies, 1 + 0.8 * np.sin(2 * time), 1.0), UP)
        signs = {"force": force, "height": np.convolve(np.where(flies, 5.0, 0.0), np.ones(100) / 100, "same")}
        return {"rotors": np.where(flies, 0.5, idle), "rate": np.where(flies, 3.0, hand), "noise": noise} | {
            name: signs[name] for name in known
        }

    return made


def profile(drag):
    """Up at 10 m/s and down at 8 m/s by turns, with a drag so large, 1/m."""

    def made(time):
        speed = lfilter([0.01], [1, -0.99], np.where(time % 150 < 75, 10.0, -8.0))
        felt = 1 + np.gradient(speed, time) / 9.81
        level = 0.4 * np.sqrt(np.maximum(felt + drag * speed * np.abs(speed) / 9.81, 0.05))
        height = 100 + 0.01 * np.cumsum(speed)
        return {"rotors": level, "rate": 0.1, "height": height, "force": np.outer(felt, UP), "shakes": 0.03}

    return made


def dead_rotor(begin, end):
    """The third rotor reads zero."""
    return lambda time: {
        "rotors": (0.5 + 0.05 * np.sin(time))[:, None] * inside(time, begin, end, [1, 1, 0, 1], 1.0),
        "force": UP,
        "height": 5 + np.sin(time / 3),
    }


def tilted(degrees):
    """Its sensors lean while it hovers, and its rotors differ."""
    lean = np.radians(degrees)
    return lambda _: {"rotors": [(0.4, 0.4, 0.2, 0.2)], "force": np.array([np.sin(lean), 0, np.cos(lean)])}


def bump(at, rows=1, **more):
    return lambda time: {"force": inside(time, at, at + 0.01 * rows, [4.6, 0, 1], UP)} | more


def bench(time, noise, **more):
    return {"rotors": 0.4, "rate": 0, "noise": noise, "lean": 0.03 + 0 * time, "force": UP, "shakes": 0.02} | more


def turned_over(shakes, rises):
    """A bench whose attitude turns over, and height drifts."""
    return lambda time: bench(time, 0.05, rate=0.02, shakes=shakes / 9.81, lean=0.15 * time, height=rises * time)


def lies(seconds, *known):
    """It hits the ground at 20 s, and lies on its side with its rotors on for so long."""

    def made(time):
        signs = {"force": inside(time, 0, 20, UP, [0, 1, 0]), "lean": inside(time, 20, np.inf, np.pi / 2 + 0.2)}
        turns = {"rate": inside(time, 0, 20, 0.3), "rolls": inside(time, 20, 20.4, 4)}
        return {"rotors": inside(time, 0, 20 + seconds, 0.5)} | turns | {name: signs[name] for name in known}

    return made


def stops(time):
    """Its rotors stop at 30 s, and it hits the ground less hard than something hit it in flight."""
    force = inside(time, 10, 10.04, 12 * UP, inside(time, 30, 31.2, 0 * UP, inside(time, 31.2, 31.24, 8 * UP, UP)))
    return {"rotors": inside(time, 0, 30, 0.5), "rate": inside(time, 0, 30, 0.3), "force": force, "shakes": 0.02}


def cut_at_the_end(felt, until):
    """Its rotors fall to idling 0.6 s before the log ends, and it feels so many weights from then on, or later one."""

    def made(time):
        force = np.outer(inside(time, 29.4, 29.4 + until, felt, 1.0), UP)
        return {"rotors": inside(time, 0, 29.4, 0.5, 0.08), "rate": 0.3, "force": force, "shakes": 0.02}

    return made


def turns_hard(time):
    """It feels 1.7 weights throughout, and lands."""
    flies = inside(time, 0, 24, 1.0)
    force = np.outer(inside(time, 0, 24, 1.7, 1.0), UP)
    return {"rotors": 0.08 + 0.42 * flies, "rate": 1.5 * flies, "force": force, "shakes": 0.02}


def dives(time):
    """Its throttle is cut for 0.8 s in each six, and the log ends in such a dive."""
    cut = time % 6 > 5.2
    force = np.outer(np.where(cut, 0.2, 1.15), UP)
    return {"rotors": np.where(cut, 0.06, 0.5), "rate": 2.0, "force": force, "shakes": 0.02}


def tumbles(known):
    """Its rotors stop at 40 s, 30 m up; or it is hit there, and nothing is known of rotors and height."""

    def made(time):
        falls = inside(time, 40, 42.4, 1) > 0
        hit = 42.4 if known else 40.0
        signs = {
            "rate": inside(time, 5, 40, 0.3),
            "rolls": inside(time, 40.7 if known else 40, hit + 0.4, 6.0 if known else 14.0),
            "force": np.where((falls & known)[:, None], 0.05 * UP, inside(time, hit, hit + 0.04, [3, 4, 9], UP)),
            "shakes": 0.02,
        }
        if not known:
            return {"rotors": None} | signs
        height = np.where(falls, 30 - 4.9 * (time - 40) ** 2, inside(time, 5, 40, 30))
        return {"rotors": inside(time, 5, 40, 0.5), "height": np.maximum(height, 0)} | signs

    return made


def gentle(time):
    """Two flights that hardly turn, between which its rotors idle and shake for 30 s."""
    flies = inside(time, 3, 38, 1) + inside(time, 70, 105, 1) > 0
    level = np.where(flies, 0.5 + 0.01 * np.sin(0.8 * time), inside(time, 1, 107, 0.06))
    return {"rotors": level, "rate": 0.1 * flies, "noise": 0.15}


def stands_after_a_hit(time):
    """It hovers, sinks, hits the ground, and stands there with rotors that its controller winds up."""
    flies = inside(time, 3, 20, 1) > 0
    felt = np.where(flies, 1 + 0.03 * np.sin(0.8 * time) - inside(time, 18.5, 20, 0.2), 1.0)
    felt = inside(time, 20, 20.04, 6.0, felt)
    wound = (0.3 + 0.2 * np.sin(0.7 * time))[:, None] * [1.5, 0.2, 1.5, 0.3]
    rotors = np.where((time < 20)[:, None], (0.4 * np.sqrt(felt) * flies)[:, None], wound)
    rocks = inside(time, 20, 60, 0.4, 0.2 * flies)
    return {"rotors": rotors, "rate": rocks, "force": np.outer(felt, UP), "shakes": 0.02}


def on_its_back(recovers):
    """It turns over at 20 s, and flies there with rotors that turn the other way, or rocks on the ground."""

    def made(time):
        over = inside(time, 20, 30 if recovers else 60, 1) > 0
        felt = np.where(over, -1.0, inside(time, 36, 39, 1.6, 1 + 0.1 * np.sin(2 * time)))
        turns = inside(time, 19.5, 20, 2 * np.pi) + recovers * inside(time, 29.5, 30, 2 * np.pi)
        return {"rotors": inside(time, 3, 57, 0.5), "rate": inside(time, 3, 57, 0.8), "rolls": turns} | {
            "force": np.outer(felt, UP)
        }

    return made


def two_rotors(time):
    """A bench that feels two of four rotors."""
    works = 0.5 + 0.1 * np.sin(time)
    return {"rotors": np.outer(works, [1, 0, 1, 0]), "rate": 0.3, "force": np.outer(1 + 0.15 * np.sin(time), UP)}


def works_by_turns(time):
    """A bench whose rotors work and idle, and shake it."""
    return bench(time, 0.3, rotors=np.where(time % 20 < 10, 0.5, 0.06), rate=0.1)


ALL, APART = ((0, np.inf),), ((3, 30), (50, 77))
RESTS = ("rests with its rotors on",)
READ = {
    **{
        f"a slow climb, noise {own}": (60, slow_climb(*own), ALL)
        for own in ((0.006, 0.002), (0.02, 0.002), (0.02, 0.03), (0.05,))
    },
    **{
        f"a steady climb at {speed} m/s": (
            60,
            lambda t, speed=speed: (
                {"rate": 0, "noise": 0.003, "height": speed * t, "lean": 0.005 * np.sin(t)} | calm(1 + 0 * t)
            ),
            ALL,
        )
        for speed in (2, 5)
    },
    "a steady climb, its height in steps of 1 m": (
        60,
        lambda t: {"rate": 0, "noise": 0.003, "height": np.round(0.5 * t)} | calm(1 + 0 * t),
        ALL,
    ),
    "a dead gyroscope that climbs": (40, lambda t: {"rate": 0, "noise": 0.001, "height": 0.2 * t}, ALL),
    "likewise, at one force": (40, lambda t: {"rate": 0, "noise": 0.001, "height": 0.2 * t} | calm(1 + 0 * t), ALL),
    "likewise, that leans": (
        40,
        lambda t: (
            {"rate": 0, "noise": 0.001, "height": 5 + np.sin(0.3 * t), "lean": 0.5 * np.sin(0.15 * t)} | calm(1 + 0 * t)
        ),
        ALL,
    ),
    **{f"a calm hover, noise {noise}": (40, hover(noise), ALL) for noise in (0.0023, 0.009, 0.018)},
    **{
        f"idling that shakes by {noise}, {known}": (80, acrobatics(*known, noise=noise / np.sqrt(3)), APART)
        for noise in (0.15, 0.25, 0.4)
        for known in ((), ("force",), ("force", "height"))
    },
    "gentle flights, idling that shakes": (110, gentle, ((3, 38), (70, 105))),
    "a flight that hits, and stands with its rotors on": (60, stands_after_a_hit, ((3.5, 20),), ("impact",)),
    "a flight on its back": (60, on_its_back(recovers=True), ((3, 57),)),
    "on its back on the ground": (60, on_its_back(recovers=False), ((3, 20),), ("loss of control",)),
    "a bench whose rotors work by turns": (100, works_by_turns, ()),
    "a bench of two rotors that is felt": (60, two_rotors, ()),
    "idling that is moved by hand": (80, acrobatics(hand=0.3), APART),
    "carried by hand between two flights": (80, acrobatics("force", idle=0.0, hand=2.0), APART),
    "moved with idling rotors, then a calm hover": (
        120,
        lambda t: {"rotors": inside(t, 70, 110, 0.5, 0.06), "rate": inside(t, 70, 110, 0.1, 0.5)},
        ((70, 110),),
    ),
    "a flight, then moved with idling rotors": (
        60,
        lambda t: {"rotors": inside(t, 3, 20, 0.5, inside(t, 20, 50, 0.07)), "rate": inside(t, 3, 20, 1.0, 0.35)},
        ((3, 20),),
    ),
    "acrobatics that end in a calm hover": (
        45,
        lambda t: {
            "rotors": inside(
                t, 2, 30, np.where(t % 2 < 0.5, 0.75, np.where(t % 2 < 1.2, 0.05, 0.2)), inside(t, 30, 45, 0.19)
            ),
            "rate": inside(t, 2, 30, 5.0, inside(t, 30, 45, 0.2)),
        },
        ((2, np.inf),),
    ),
    "acrobatics that mostly idle, and idling on the ground": (
        140,
        lambda t: {
            "rotors": inside(t, 8, 80, np.where(t % 4 < 1.2, 0.6, 0.08), inside(t, 5, 140, 0.08)),
            "rate": inside(t, 8, 80, 5.0),
        },
        ((8, 77),),
    ),
    "a rotor that reads zero": (40, dead_rotor(0, 40), ALL),
    "a rotor that reads zero for a while": (40, dead_rotor(15, 25), ALL),
    "a cruise with trim": (
        60,
        lambda t: {
            "rotors": 0.3 * (1 + np.outer(inside(t, 15, 45, 0.45), [1, -1, -1, 1])),
            "lean": inside(t, 15, 45, 0.5),
            "force": inside(t, 15, 45, [-0.4, 0, 0.9], UP),
        },
        ALL,
    ),
    **{f"a board tilted by {tilt} deg, with trim": (40, tilted(tilt), ALL) for tilt in (20, 90)},
    **{f"a sideways jolt at {at} s": (40, bump(at), ALL) for at in (10, 30.5, 38.5, 39.5)},
    **{f"a longer one at {at} s": (40, bump(at, 6, height=10), ALL) for at in (36, 38.5, 39.5)},
    "a punch of a board with x up before the log ends": (
        40,
        lambda t: {
            "rotors": 0.4 * np.sqrt(inside(t, 38.3, 38.8, 4, 1)),
            "force": np.outer(inside(t, 38.3, 38.8, 4, 1), [1, 0, 0]),
        },
        ALL,
    ),
    "a bench that is bumped": (
        60,
        lambda t: bench(t, 0.1, force=UP + np.outer(inside(t, 30, 31.5, 0.02), [1, 0, 0]), shakes=0.15),
        (),
    ),
    "a bench whose height steps": (60, lambda t: bench(t, 0.02, height=inside(t, 30, 60, 0.3), shakes=0.05), ()),
    "a bench whose height drifts": (60, lambda t: bench(t, 0.02, height=0.025 * t), ()),
    "a bench whose height sinks": (60, lambda t: bench(t, 0.003, height=np.clip(9 - 0.3 * t, 0, 0.7)), ()),
    "a bench whose height runs away": (60, lambda t: bench(t, 0.005, height=100 * np.sin(0.3 * t) ** 2), ()),
    **{
        f"a bench whose attitude turns over, {own}": (60, turned_over(*own), ())
        for own in ((0.1, 0), (0.5, 0.1), (1, 0), (3, 0.1))
    },
    **{f"up and down, drag {drag}": (300, profile(drag), ALL) for drag in (0.03, 0.08)},
    "a landing of a trimmed vehicle": (
        40,
        lambda t: {"rotors": np.outer(inside(t, 0, 30, 1.0), (0.8, 0.8, 0.2, 0.2)), "rate": inside(t, 0, 30, 0.3)},
        ((0, 30),),
    ),
    "a landing with uneven rotors": (
        60,
        lambda t: {
            "rotors": 0.5 + np.outer(inside(t, 30, 60, 0.15), [1, 1, -1, -1]),
            "rate": inside(t, 0, 30, 0.3, 0.006),
            "force": UP,
            "shakes": 0.03,
            "height": np.clip(30 - t, 0, 3),
        },
        ((0, 30),),
        RESTS,
    ),
    **{
        f"on its side for {seconds} s, {known}": (26 + seconds, lies(seconds, *known), ((0, 20),), RESTS)
        for seconds in (0.8, 1.6, 2.5)
        for known in (("lean",), ("force", "lean"))
    },
    "rotors that stop": (40, stops, ((0, 30),), ("rotors stop in the air", "impact")),
    "idling that falls until the log ends": (30, cut_at_the_end(0.4, 0.6), ((0, 29.4),), ("rotors stop in the air",)),
    "idling that touches the ground": (30, cut_at_the_end(0.4, 0.2), ((0, 29.4),)),
    "idling on the ground until the log ends": (30, cut_at_the_end(0.9, 0.6), ((0, 29.4),)),
    "idling on the ground after turns that feel more than a weight": (30, turns_hard, ((0, 24),)),
    "idling in a dive, as before": (29.9, dives, ((0, 29.2),)),
    "rotors that stop high up, and a tumble": (60, tumbles(True), ((5, 40),), ("rotors stop in the air", "impact")),
    "likewise without its rotors": (60, tumbles(False), ((5, 40),), ("impact",)),
    "a throttle cut": (
        40,
        lambda t: {
            "rotors": inside(t, 20, 22.8, 0, 0.5),
            "rate": 1.0,
            "force": np.outer(inside(t, 20, 22.8, 0.05, 1), UP),
            "height": 60 - 4.9 * np.clip(t - 20, 0, 2.8) ** 2,
        },
        ALL,
    ),
}


@pytest.mark.parametrize("case", READ.values(), ids=READ)
def test_what_flies_of_drawn_flights(case):
    """Each was read wrongly by some set of rules; given are its flights, from s to s, and what ended one early."""
    seconds, made, spans, *moments = case
    time = np.arange(0.0, seconds, 0.01)
    found = find_flown(signs_of(time, **made(time)))
    assert found.flies == bool(spans)
    assert [name for name, _ in found.moments] == list(*moments)
    ends = np.array(found.stretches_s).reshape(-1, 2)
    assert ends == pytest.approx(np.clip(spans, 0, time[-1]).reshape(-1, 2), abs=0.75)


def test_what_falls_a_little_since_its_rotors_were_off_loses_no_control():
    """The ground shakes it, of which without an accelerometer nothing is felt."""
    level, height = between(5, 30, 0.5), np.interp(TIME, [5, 8, 30, 30.4], [0, 0.4, 0.4, 0])
    flown = flown_by(level, height, turning(5, 30) + between(30.4, 30.6, 15.0) * np.sin(60 * TIME))
    assert (flown.flies, flown.ended) == (True, "")
