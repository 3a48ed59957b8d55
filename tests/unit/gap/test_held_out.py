"""The gap of flights that no fit has seen: its size, the share that is gone, and flights of another vehicle."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.catalogue.parameter_error import shown
from cpfls_cli.errors import InputError
from cpfls_cli.gap import diagnose
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.diagnose import not_judged
from cpfls_cli.gap.naming.held_out import HeldOut, held_out
from cpfls_cli.gap.settings import CLEAR, NOISE
from tests.builders.closed_loop_flights import flown, signals_of
from tests.builders.drawn_numbers import flight_of
from tests.builders.gap_flights import candidate, fly, weak

KNOWN = np.tile([True, True, True, False, False, False], (1000, 1))
LOADS = [f"thrust M{index}" for index in range(1, 5)]
GUSTS = [f"gusts {axis}" for axis in ("roll", "pitch", "yaw")]


def noise(*sizes):
    return np.random.default_rng(0).standard_normal((1000, 6)) * np.array([*sizes, 1e3, 1e3, 1e3])


def judged(before, after, most_noise=NOISE):
    floor = np.ones((1000, 6))
    residuals = noise(*before), noise(*after), noise(*after)
    return HeldOut(*residuals, floor[0], KNOWN, floor, np.full(6, most_noise), {})


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        ((10, 10, 10), (1, 1, 1), 1.0),
        ((10, 10, 10), (5, 5, 5), 75 / (75 + 25 - 1.25)),
        ((10, 10, 10), (10, 10, 10), 0.0),
        ((5, 5, 5), (10, 10, 10), 0.0),
        ((10, 1, 1), (1, 1, 1), 1.0),
        ((10, 1, 1), (1, 4, 1), (99 - 15) / (99 - 15 + 16 - 1.25)),
    ],
    ids=["all", "three quarters", "nothing", "worse", "one axis", "moved to another axis"],
)
def test_share_is_of_what_stands_above_the_floor(before, after, share):
    found = judged(before, after)
    assert found.share_removed(found.before, found.after) == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize(("most_noise", "share"), [(NOISE, 0.65 / (0.65 + 0.44)), (CLEAR**2, 1.0)])
def test_gusts_that_blow_a_little_harder_on_the_unseen_flights_are_no_gap(most_noise, share):
    found = judged((1.1, 1.0, 1.3), (0.75, 1.0, 1.3), most_noise)
    assert found.share_removed(found.before, found.after) == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(("before", "taken"), [(1.1, False), (1.3, True)])
def test_numbers_remove_a_gap_only_where_one_stands_above_the_noise(before, taken):
    found = judged((before, 1, 1), (1, 1, 1))
    assert (found.removed_by_numbers(NOISE)[0] > 0.9) == taken
    assert found.removed_by_numbers(0.0)[0] > 0.9


@pytest.mark.parametrize(("about_z", "counts"), [(1, True), (2, False)])
def test_numbers_that_effects_make_up_for_count_by_what_is_left_without_them(about_z, counts):
    """Where formulas do not fit, if only about z, numbers may fill in for them about the other axes too."""
    found = replace(judged((1, 1, about_z), (1, 1, about_z)), stated=noise(1, 4, about_z))
    assert np.array_equal(found.removed_by_numbers(NOISE) > 0.9, [False, counts, False, False, False, False])


@pytest.mark.parametrize(("before", "own", "closed"), [(8, 0.7, True), (8, 2, False), (1.2, 0.7, False)])
def test_numbers_close_a_gap_that_was_clear(before, own, closed):
    """Names next to them then take their share of the gap as given, for of the other there is none."""
    found = judged((before, 1, 1), (own, 1, 1))
    assert (found.closed_by_numbers, found.shares()["torque"]) == (closed, 0)
    assert found.shares(as_given=True)["torque"] > 0.9


def training(chosen, seeds=(1, 2), **given):
    truth = [(candidate("com_offset"), [0.01, -0.008])]
    return system([weak(fly(seed, truth, **given)) for seed in seeds], chosen)


def unseen(chosen, seed=3, gyro=0.005):
    flight = weak(fly(seed, [(candidate("com_offset"), [0.01, -0.008])], gyro=gyro, rotor=1.0))
    fitted = training(chosen, gyro=gyro, rotor=1.0)
    return held_out([flight], [flight], fitted, fit(fitted, np.ones(6)), np.ones(6))


def test_an_effect_that_is_there_closes_the_gap_of_a_flight_not_seen():
    found = unseen([candidate("com_offset")])
    assert found.shares()["torque"] > 0.97
    before, after = found.size(found.before), found.size(found.after)
    assert (before.floors[:2] > 4).all()
    assert (after.floors[:3] < 1.35).all()
    np.testing.assert_allclose(before.value[:2], [0.008 * 6 * 9.81, 0.01 * 6 * 9.81], rtol=0.2)
    assert np.isnan(before.value[3:]).all()
    assert np.isnan(after.floors[3:]).all()


def test_an_effect_that_is_not_there_does_not():
    assert max(unseen([candidate("linear_damping")]).shares().values()) < 0.1


def test_an_inertia_that_training_flights_show_is_that_of_a_flight_that_hardly_turns():
    wrong = [(candidate("parameter_error"), [0.4, *[0.0] * 9])]
    fitted, flight = system([weak(fly(seed, wrong)) for seed in (1, 2)]), weak(fly(3, wrong))
    gentle = replace(flight, turns=shown(np.array([False, True, True])))
    linear = fit(fitted, np.ones(6))
    own, other = (held_out([each], [each], fitted, linear, np.ones(6)) for each in (gentle, flight))
    np.testing.assert_array_equal(own.parameters, other.parameters)
    assert own.size(own.parameters).value[0] < 0.1 * own.size(own.before).value[0]


def sinking(seed, speed):
    """Sinks at a speed for a third of the time."""
    signals = fly(seed, tilt=0.02)
    down = np.zeros_like(signals.velocity)
    down[:, 2] = -speed * (np.sin(2 * np.pi * signals.time / 10.0) > 0.5)
    return replace(signals, velocity=down)


def test_nothing_is_judged_where_no_flight_learned_from_went():
    """Up to 4 m/s a part of the curve is learned; of 12 m/s it says nothing."""
    ring = [candidate("vertical_descent", sideways=1.0)]
    fitted, slow, fast = system([weak(sinking(1, 4.0))], ring), weak(sinking(2, 4.0)), weak(sinking(2, 12.0))
    linear = fit(fitted, np.ones(6))
    within, beyond = (held_out([one], [one], fitted, linear, np.ones(6)) for one in (slow, fast))
    assert (within.unlearned, within.known[:, :3].all()) == ({}, True)
    signals = fast.signals
    sinks = np.interp(fast.windows.centres(signals.time), signals.time, signals.velocity[:, 2]) < -6
    assert not beyond.known[sinks, 0].any()
    assert beyond.unlearned == {"vertical_descent": pytest.approx(1 - beyond.known[:, 0].mean())}
    assert 0.3 < beyond.unlearned["vertical_descent"] < 0.5
    left = beyond.after[beyond.known[:, 0], 0]
    assert beyond.size(beyond.after).value[0] == pytest.approx(np.sqrt(np.mean(left**2)))
    (result,) = not_judged(beyond)
    assert result.startswith(
        f"{100 * beyond.unlearned['vertical_descent']:.2g} % of what is held out goes where no training flight"
    )


def test_faults_alone_take_their_share_off_the_model_as_given():
    """Without a named effect the model after them is the one with its numbers refitted."""
    found = unseen([candidate("com_offset")])
    alone = replace(found, parameters=found.after)
    assert alone.shares() == {"torque": 0.0}
    assert alone.shares(as_given=True)["torque"] > 0.97


def test_size_is_the_root_mean_square():
    found = unseen([candidate("com_offset")])
    np.testing.assert_allclose(found.size(found.after).value[:3], np.sqrt(np.mean(found.after[:, :3] ** 2, axis=0)))
    np.testing.assert_allclose(found.size(found.after).floors[:3] * found.floor[:3], found.size(found.after).value[:3])


@pytest.mark.parametrize(
    "chosen",
    [candidate("rotor_drag"), candidate("ground_effect", G=1.0), candidate("battery_sag", exponent=1.0)],
    ids=lambda chosen: chosen.effect.kind + " " + chosen.effect.name,
)
def test_flights_without_the_signals_of_an_effect_are_refused(chosen):
    seen = replace(fly(1), voltage=np.ones(2400))
    blind = weak(replace(fly(2), velocity=None, position=None))
    fitted = system([weak(seen)], [chosen])
    with pytest.raises(InputError, match="lack a signal that a named effect needs"):
        held_out([blind], [blind], fitted, np.zeros(fitted.base.shape[2]), np.ones(6))


@pytest.fixture
def result(monkeypatch):
    """Tell the loads of flights whose names say by how much M3 is asked for more, and the air is rougher."""
    rng = np.random.default_rng(1)
    signals = signals_of(flown())

    def numbers(recording):
        load, rough = map(float, recording.name.split())
        values = [*(0.01 * rng.normal(size=4) + [0, 0, load, 0]), *(0.1 * rng.normal(size=3) + rough)]
        return flight_of(recording.name, dict(zip([*LOADS, *GUSTS], values, strict=True)))

    monkeypatch.setattr(diagnose, "flight_numbers", numbers)
    return lambda *names: diagnose._changed_between(
        [replace(signals, name=name) for name in names[:-1]], [replace(signals, name=names[-1])]
    )


def test_a_weak_rotor_in_the_held_out_flight(result):
    (sentence,) = result("0 0", "0 0", "0.5 0")
    assert "is not that of the training flights" in sentence
    assert "rotor M3, sure to" in sentence


def test_nothing_is_said_of_like_flights_or_of_one_or_of_rougher_air(result):
    assert (result("0 0", "0 0", "0 0"), result("0 0", "0.5 0")) == ((), ())
    calm = ["0 0"] * 5
    assert result(*calm, "0 2") == ()
    (sentence,) = result(*calm, "0.5 2")
    assert "rotor M3, sure to" in sentence


def test_nothing_is_said_without_rotors(monkeypatch):
    def refuse(_recording):
        raise InputError("has no rotor_speed")

    monkeypatch.setattr(diagnose, "flight_numbers", refuse)
    flight = replace(signals_of(flown()), name="flight.h5")
    assert diagnose._changed_between([flight, flight], [flight]) == ()
