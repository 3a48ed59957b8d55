"""Shares of thrust in steady flight, their intervals and what may cause them."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.flightlog.airframe import usual_airframe
from cpfls_cli.flightlog.vocabulary import BETAFLIGHT
from cpfls_cli.look.balance import balance_of
from cpfls_cli.look.flight import Samples
from cpfls_cli.look.reading import Rotors
from tests.builders.look_flights import CROSS, SPINS, hovering

CURVE = {"parameters": {"MOT_THST_EXPO": 0.0001, "MOT_SPIN_MIN": 0.0, "MOT_SPIN_MAX": 1.0}, "autopilot": "ardupilot"}
"""Commands are thrust, as the log states."""
EVEN = np.ones(4)


def shares(balance):
    return np.array([rotor.share.value for rotor in balance.rotors])


def kinds(balance):
    return {(cause.kind, cause.rotor) for cause in balance.causes}


def test_a_weak_rotor_works_more_and_intervals_cover():
    """One of 90 % of the others' thrust gets a command 1/0.9 as large."""
    truth = np.array([1, 1, 1 / 0.9, 1])
    truth = truth / truth.mean()
    inside = np.zeros(4)
    for seed in range(100):
        balance = balance_of(hovering(EVEN, seed, weak={2: 0.9}, **CURVE))
        assert np.abs(shares(balance) - truth).max() < 0.02
        inside += [r.share.low <= t <= r.share.high for r, t in zip(balance.rotors, truth, strict=True)]
    assert np.all((inside >= 88) & (inside <= 100))
    assert inside.mean() >= 92


def test_a_single_rotor_is_one_cause_of_several():
    balance = balance_of(hovering(EVEN, weak={2: 0.75}, gusts=0.005, **CURVE))
    assert balance.uneven[0] == 3
    assert kinds(balance) == {("rotor", 3), ("centre of mass", 0), ("yaw torque", 0), ("wind", 0)}
    alone = {cause.kind: cause.alone for cause in balance.causes}
    assert alone == {"rotor": True, "centre of mass": False, "yaw torque": False, "wind": False}
    (rotor,) = (cause for cause in balance.causes if cause.kind == "rotor")
    assert rotor.size.low < (1 / 0.75 - 1) / ((3 + 1 / 0.75) / 4) < rotor.size.high


def test_spins_of_which_one_is_not_known_are_not_known():
    """By those alone that are, rotors of a hover would be expected to work as none do."""
    frame = usual_airframe(BETAFLIGHT, 4)
    _, spins = Rotors(None, None, frame).layout()
    assert sorted(spins) == [-1, -1, 1, 1]
    first, *others = frame.rotors
    places, spins = Rotors(None, None, replace(frame, rotors=(first._replace(spin=0), *others))).layout()
    assert places.shape == (4, 2)
    assert spins is None


def test_a_centre_of_mass_is_found():
    """Rotors of an X that hold a mass 5 % of the arm ahead of the middle: sum of place times thrust."""
    ahead = 0.05 / np.mean(CROSS[:, 0] ** 2) * CROSS[:, 0]
    balance = balance_of(hovering(1 + ahead, gusts=0.005, **CURVE))
    (cause,) = (cause for cause in balance.causes if cause.kind == "centre of mass")
    assert cause.alone
    assert (cause.unit, cause.forward.value) == ("share of the arm", pytest.approx(0.05, abs=0.0025))
    assert cause.right.value == pytest.approx(0, abs=0.0025)
    assert kinds(balance) == {("centre of mass", 0), ("wind", 0)}


def test_turns_of_the_heading_part_wind_from_the_body():
    ahead = 0.04 / np.mean(CROSS[:, 0] ** 2) * CROSS[:, 0]

    def turning(time):
        return np.pi * (time > 30)

    balance = balance_of(hovering(1 + ahead, gusts=0.005, heading=turning, wind=(0.06, 0.03), **CURVE))
    assert balance.fixed_forward.low < 0.04 < balance.fixed_forward.high
    assert balance.fixed_right.low < 0 < balance.fixed_right.high
    assert balance.wind.low < np.hypot(0.06, 0.03) < balance.wind.high
    assert balance.turned == pytest.approx(1, abs=0.01)
    one_way = balance_of(hovering(1 + ahead, gusts=0.005, wind=(0.06, 0.03), **CURVE))
    assert one_way.wind is None
    assert ("wind", 0) in kinds(one_way)


def test_wind_alone_is_no_centre_of_mass_after_a_turn():
    balance = balance_of(hovering(EVEN, gusts=0.005, heading=lambda t: t / 8, wind=(0.1, 0.0), **CURVE))
    assert ("centre of mass", 0) not in kinds(balance)


def test_a_yaw_trim_is_positive_clockwise_and_roll_to_the_right():
    """Rotors that turn counter-clockwise drive a clockwise turn; left ones roll to the right; front ones pitch up."""
    pattern = 1 - 0.05 * CROSS[:, 1] + 0.03 * CROSS[:, 0] + 0.1 * SPINS
    balance = balance_of(hovering(pattern, gusts=0.001, **CURVE))
    trims = [balance.roll.value, balance.pitch.value, balance.yaw.value]
    assert trims == pytest.approx([0.05, 0.03, 0.1], abs=0.003)


def test_sound_rotors_need_no_cause():
    balance = balance_of(hovering([1.01, 0.99, 1.005, 0.995], gusts=0.005, **CURVE))
    assert (balance.uneven, balance.causes) == ((), ())
    assert balance.even
    assert not balance_of(hovering([1.1, 0.9, 1.0, 1.0], gusts=0.005, **CURVE)).even
    # Wide intervals show neither.
    blurred = balance_of(hovering(EVEN, gusts=0.15, **CURVE))
    assert blurred.uneven == ()
    assert not blurred.even


def test_rotors_that_work_alike_are_sound_wherever_the_autopilot_has_them():
    """About stated places that are 5 % of the arm too far back, rotors ahead would have to work less than others."""
    even = hovering(EVEN, gusts=0.005, **CURVE)
    back = balance_of(replace(even, places=even.places - [0.05, 0.0]))
    expected = np.array([rotor.expected for rotor in back.rotors])
    assert np.abs(expected - 1).max() > 0.05
    assert (back.uneven, back.causes, back.even) == ((), (), True)
    asked = balance_of(replace(hovering(expected, gusts=0.005, **CURVE), places=even.places - [0.05, 0.0]))
    assert (asked.uneven, asked.causes) == ((), ())
    weak = hovering(EVEN, weak={2: 0.75}, gusts=0.005, **CURVE)
    assert balance_of(replace(weak, places=even.places - [0.05, 0.0])).uneven[0] == 3


def test_a_weak_rotor_that_is_asked_for_less_is_not_sound_by_working_as_much_as_the_mean():
    """What it works more is shown by the rotor that balances it, of the same spin."""
    places = CROSS - [0.05, 0.0]
    expected = np.array(
        [rotor.expected for rotor in balance_of(replace(hovering(EVEN, **CURVE), places=places)).rotors]
    )
    assert expected[1] < 0.95
    weak = balance_of(replace(hovering(expected, weak={1: 0.9}, gusts=0.005, **CURVE), places=places))
    assert shares(weak)[1] == pytest.approx(1, abs=0.02)
    assert (weak.uneven, weak.even) == ((4,), False)
    assert weak.causes[0].rotor == 2


def test_unknown_thrust_curves_widen_the_centre_of_mass():
    """Between straight and square, a share of commands is one to two of thrust."""
    balance = balance_of(hovering(1 + 0.05 / np.mean(CROSS[:, 0] ** 2) * CROSS[:, 0], gusts=0.001))
    assert balance.measured_by == "command"
    (cause,) = (cause for cause in balance.causes if cause.kind == "centre of mass")
    assert cause.forward.low == pytest.approx(0.05, abs=0.003)
    assert cause.forward.high == pytest.approx(0.1, abs=0.006)


def test_squared_speeds_share_thrust():
    """Equal speeds at a command a tenth larger: the motor of rotor 1, not its load."""
    flight = hovering(EVEN, gusts=0.001, weak={0: 1 / 1.1}, **CURVE)
    speed = Samples(flight.time, np.full_like(flight.rotors.values, 500.0))
    balance = balance_of(replace(flight, rotor_speed=speed))
    assert balance.measured_by == "rotor speed"
    assert shares(balance) == pytest.approx(1, abs=1e-9)


def test_limits_are_kept_out():
    flight = hovering(EVEN, gusts=0.001, **CURVE)
    command = flight.rotors.values.copy()
    command[100:120, 1] = 1.0
    command[200:210, 1] = 1.0
    command[300:304, 3] = 0.0
    balance = balance_of(replace(flight, rotors=flight.rotors._replace(values=command)))
    assert shares(balance) == pytest.approx(1, abs=0.003)


def test_what_is_lacking_is_named():
    flight = hovering(EVEN, **CURVE)
    fast = replace(flight, body_rate=np.add(flight.body_rate, [1.0, 0, 0]))
    assert balance_of(fast).lacks == "steady flight"
    assert all(rotor.share is None for rotor in balance_of(fast).rotors)
    assert balance_of(replace(flight, places=None)).lacks == "places"
    assert balance_of(replace(flight, spins=None)).yaw is None
    assert balance_of(replace(flight, rotors=Samples(np.empty(0), np.empty((0, 0))))) is None
