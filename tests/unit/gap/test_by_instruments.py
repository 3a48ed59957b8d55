"""What instruments say of an effect, and of what is left: whether it is 0, whether it is the air."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import ttest_1samp

from cpfls_cli.blocks import jackknife_error
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming import by_instruments, by_samples
from cpfls_cli.gap.naming.by_instruments import (
    _chance,
    _ends,
    _Source,
    _sources,
    _stepped,
    _strong,
    _strong_together,
    _Windows,
    holding,
    significant_effects,
    with_lean,
)
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, fitted
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.innovations import PER_WINDOW, innovations
from cpfls_cli.playback.instruments import held as stays
from tests.builders.gap_flights import candidate, fly, weak

BLOCKS, WINDOWS = 20, 12
OWN, OTHER = np.array([True, False]), np.array([False, True])
LAGS = np.zeros(2, dtype=bool)


def crossed(values, rng):
    """Products by block of two numbers that move alike, in gusts that the loop mixes into both."""
    known = rng.standard_normal((BLOCKS, WINDOWS, 2)) @ np.array([[1.0, 0.8], [0.0, 0.6]])
    gust = rng.standard_normal((BLOCKS, WINDOWS, 1))
    moved = known + gust * [0.7, -0.5]
    rows = np.concatenate([moved, (gust[..., 0] + moved @ np.array(values))[..., None]], axis=2)
    known = np.concatenate([known, np.zeros((BLOCKS, WINDOWS, 1))], axis=2)
    return np.einsum("bwk,bwl->bkl", known, rows)


def test_what_is_nothing_is_taken_for_something_as_often_as_chance_does():
    rng = np.random.default_rng(1)
    # The other number is not 0, and refitted.
    chances = np.array([_chance(crossed([0.0, 2.0], rng), OWN, OTHER, np.zeros(2)) for _ in range(400)])
    assert 0.02 < (chances < 0.05).mean() < 0.09
    assert 0.4 < chances.mean() < 0.6
    assert _chance(crossed([2.0, 2.0], rng), OWN, OTHER, np.zeros(2)) < 1e-3
    products = crossed([0.2, 0.0], np.random.default_rng(2))
    expected = ttest_1samp(products[:, 0, -1], 0.0).pvalue
    assert _chance(products, OWN, np.zeros(2, dtype=bool), np.zeros(2)) == pytest.approx(expected)


@pytest.mark.parametrize(("apart", "result"), [(0.6, [True, True, False]), (0.02, [True, False, False])])
def test_of_numbers_that_instruments_hardly_separate_the_weaker_is_not_said(apart, result):
    """A load and a wrong thrust, which in hover do the same; and one of which nothing is known."""
    rng = np.random.default_rng(5)
    known = rng.standard_normal((BLOCKS, WINDOWS, 3))
    known[..., 1] = known[..., 0] + apart * known[..., 1]
    moved = known + rng.standard_normal((BLOCKS, WINDOWS, 1)) * [0.3, 1.0, 1.0]
    known[..., 2] = rng.standard_normal((BLOCKS, WINDOWS))
    left = np.zeros((BLOCKS, WINDOWS, 1))
    products = np.einsum("bwk,bwl->bkl", np.concatenate([known, left], axis=2), np.concatenate([moved, left], axis=2))
    assert _strong(products, np.ones(3, dtype=bool)).tolist() == result


def result(true, found, reach, rng):
    """What a source knows of three numbers, found where they are not: `reach` of what they move, next to gusts."""
    known = rng.standard_normal((BLOCKS, WINDOWS, 3)) * reach
    gust = rng.standard_normal((BLOCKS, WINDOWS, 1))
    moved = known + gust * [0.7, -0.5, 0.3]
    left = gust[..., 0] + moved @ (np.array(true) - found)
    rows = np.concatenate([moved, left[..., None]], axis=2)
    known = np.concatenate([known, np.zeros_like(gust)], axis=2)
    return _Source(np.einsum("bwk,bwl->bkl", known, rows), np.ones(3, dtype=bool))


@pytest.mark.parametrize(
    ("true", "names"),
    [([1.0, 2.0, -1.0], ["wind"]), ([1.0, 0.0, 0.0], ["rotor_drag"]), ([0.0, 0.0, 0.0], [])],
    ids=["a wind", "a drag in still air", "nothing"],
)
@pytest.mark.parametrize("knows", [True, False], ids=["both sources know it", "one hardly does"])
def test_an_effect_stands_where_any_source_shows_it_and_what_it_holds_where_that_is_all(
    true, names, knows, monkeypatch
):
    found, stand = np.array(true) + 0.02, []
    wind = Candidate(CATALOGUE["wind"].exact, {"W_x": found[1], "W_y": found[2]})
    hypothesis = SimpleNamespace(chosen=[wind], places=((wind, slice(1)),), shape_values=found[1:])
    fit = NamedFit(hypothesis, SimpleNamespace(linear=found[:1], effects=[()]), np.ones(6), GapSettings())
    for seed in range(20):
        rng = np.random.default_rng(seed)
        sources = [result(true, found, 1.0 if knows else 0.03, rng), result(true, found, 1.0, rng)]
        monkeypatch.setattr(by_instruments, "_sources", lambda *_, those=sources: those)
        stand.append([each.effect.name for each, _ in significant_effects(fit, None, fit.settings.significance)])
    assert stand.count(names) >= 17


@pytest.mark.parametrize(
    ("asked", "reach", "held"),
    [([0.0, 0.0, 2.0], 0.3, True), ([0.0, 0.0, 2.0], 3.0, False), (None, 0.3, False)],
    ids=["it stays", "it flies though the setpoint stands still", "nothing is known"],
)
def test_who_is_asked_to_stay_and_does_is_asked_for_nothing(asked, reach, held):
    flown = reach * np.sin(np.linspace(0, 20, 200))[:, None] * [1.0, 0.5, 0.2] + [0.0, 0.0, 2.0]
    setpoints = {} if asked is None else {"position": np.tile(asked, (200, 1))}
    flight = SimpleNamespace(setpoints=setpoints, has_position=True, motion=SimpleNamespace(position=flown))
    assert stays(flight) is held


def test_what_was_before_knows_nothing_of_what_is_new_in_a_gust():
    rng, fades = np.random.default_rng(3), 0.9
    gust = lfilter([1.0], [1.0, -fades], rng.standard_normal((30000, 6)), axis=0)
    # A loop that answers gusts, and what is asked of it. Its number is right: what is left is the gust alone.
    moved = lfilter([1.0], [1.0, -0.9], rng.standard_normal(gust.shape) - 0.5 * gust, axis=0)
    (new,), (known,), lasts = innovations([np.stack([moved, gust], axis=2)], [gust], [moved[..., None]])
    assert lasts[:, 0] == pytest.approx(fades ** (PER_WINDOW // 4), abs=0.05)
    assert (moved * gust).sum() / (moved**2).sum() < -0.15
    assert abs((known[..., 0] * new[..., 1]).sum() / (known[..., 0] * new[..., 0]).sum()) < 0.05


def test_runs_that_are_too_short_tell_nothing_of_what_was_before():
    rng = np.random.default_rng(4)
    rows = [rng.standard_normal((5, 6, 3)), rng.standard_normal((40, 6, 3))]
    new, known, _ = innovations(rows, [each[..., -1] for each in rows], [each[..., :-1] for each in rows])
    assert [len(each) for each in new] == [len(each) for each in known]
    assert len(new[0]) == 0 < len(new[1])


@pytest.mark.parametrize(("across", "more"), [((0.3, 0.4), 0.0025), ((0.3, np.inf), 0.0009), ((np.nan, np.nan), 0.0)])
def test_a_vehicle_that_leans_against_gusts_may_have_more_thrust(across, more):
    """Of 1 kg at 10 m/s^2: gusts of 0.5 N that are fixed in the world push it down by 0.025 N on the mean."""
    flights = [SimpleNamespace(signals=SimpleNamespace(vehicle=SimpleNamespace(mass_kg=1.0, gravity_m_s2=10.0)))]
    numbers = [Estimate(name, "1", 0.2, 0.19, 0.21, (-0.9, 3.0)) for name in ("inertia_x", "thrust_scale")]
    given = NamedFit(SimpleNamespace(flights=flights), Estimates(np.zeros(0), (), tuple(numbers), ()), None, None)
    inertia, thrust = with_lean(given, np.array(across)).estimates.parameters
    assert inertia == numbers[0]
    assert (thrust.value, thrust.low) == (0.2, 0.19)
    assert thrust.high == pytest.approx(0.21 + 1.2 * more)


def test_the_hook_of_a_load_follows_its_torque_and_mass(monkeypatch):
    """Instruments move both; the depth moves with them, in all blocks and without each, and not by its own."""
    effect = (candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.1), [0.06, 0.0, 0.0, 0.6])
    flights = [weak(fly(1, [effect], seconds=30.0, speed=1.0), force=True)]
    found = fitted(flights, [effect[0]], np.full(6, 0.1), GapSettings())
    linear, rng = len(found.estimates.linear), np.random.default_rng(1)
    rows = rng.standard_normal((240, 6, len(found.values) + 1))
    windows = [_Windows(rows, rows, np.repeat(np.arange(20), 12))]
    monkeypatch.setattr(by_instruments, "_windows_of_runs", lambda *_: (windows, windows))
    sources = _sources(found, None)
    identified = dict(zip([shape.name for shape in effect[0].effect.shapes], sources[0].numbers[linear:], strict=True))
    assert identified == {"length_m": True, "damping_1_s": True, "depth_m": False}
    values, left_out = _stepped(found, sources, np.zeros((0, len(found.values))))
    for moved in (values, *left_out):
        depth, _, _, mass = moved[linear - 4 : linear]
        assert moved[-1] == pytest.approx(np.clip(depth / mass, 0.0, 0.3))
    assert np.ptp(left_out[:, -1]) > 0


def by_each(numbers, rng, blocks=(BLOCKS, BLOCKS)):
    """Two numbers in gusts, of which each has its own source, whose products are of blocks of its own."""
    sources = []
    for number, own in enumerate(blocks):
        known = rng.standard_normal((own, 5 * WINDOWS, 2)) @ np.array([[1.0, 0.8], [0.0, 0.6]])
        gust = rng.standard_normal((own, 5 * WINDOWS, 1))
        moved = known + gust * [0.7, -0.5]
        rows = np.concatenate([moved, gust + moved @ np.array(numbers)[:, None]], axis=2)
        products = np.zeros((sum(blocks), 3, 3))
        products[number * blocks[0] :][:own, :2] = np.einsum("bwk,bwl->bkl", known, rows)
        sources.append(_Source(products, np.arange(2) == number))
    return sources


def test_the_error_of_a_number_holds_that_of_another_one_that_another_source_identifies(monkeypatch):
    monkeypatch.setattr(by_instruments, "known_before", lambda _: np.zeros(2))
    hypothesis = SimpleNamespace(chosen=[], followed=lambda rows: rows)

    def stepped(sources, at, fits):
        """Step from values; the products hold the residual of values 0."""
        there = [each._replace(products=each.products.copy()) for each in sources]
        for each in there:
            each.products[:, :, -1] -= each.products[:, :, :2] @ at
        found = SimpleNamespace(values=at, hypothesis=hypothesis, estimates=SimpleNamespace(linear=at))
        return _stepped(found, there, fits)

    values, errors = [], []
    for seed in range(200):
        sources, moved = by_each([1.0, -2.0], np.random.default_rng(seed)), np.zeros(2)
        for _ in range(60):
            moved, left_out = stepped(sources, moved, np.zeros((0, 2)))
        for products, own in sources:
            left = products[:, :, -1] - products[:, :, :2] @ moved
            assert left[:, :2][:, own].sum() == pytest.approx(0.0, abs=1e-6 * np.abs(products).sum())
        values.append(moved)
        errors.append(jackknife_error(left_out))
    assert np.mean(values, axis=0) == pytest.approx([1.0, -2.0], abs=0.05)
    assert np.median(errors, axis=0) == pytest.approx(np.std(values, axis=0), rel=0.2)
    # A number that stays where the fit found it is as uncertain as the fit, and so is what follows it.
    alone = [sources[0]]
    fits = np.array([[0.0, 0.3], [0.0, -0.3]])
    _, left_out = stepped(alone, np.zeros(2), fits)
    slope = alone[0].products.sum(axis=0)
    assert left_out[-2:, 1] == pytest.approx(fits[:, 1])
    assert np.diff(left_out[-2:, 0]) == pytest.approx(np.diff(fits[:, 1]) * -slope[0, 1] / slope[0, 0])


def test_a_number_that_trades_with_those_of_another_source_is_not_identified():
    """A drag by the past and a wind by setpoints, which show but their product."""
    rng = np.random.default_rng(3)
    first, second = by_each([0.0, 0.0], rng)
    assert [each.numbers.tolist() for each in _strong_together([first, second], LAGS)] == [[True, False], [False, True]]
    # What the second knows of its number is what the first knows of its own.
    second.products[BLOCKS:, 1, :2] = first.products[:BLOCKS, 0, :2] + 0.01 * rng.standard_normal((BLOCKS, 2))
    assert [each.numbers.tolist() for each in _strong_together([first, second], LAGS)] == [
        [True, False],
        [False, False],
    ]
    # Of a lag a fit is the loop's.
    assert [each.numbers.tolist() for each in _strong_together([first, second], OTHER)] == [
        [True, False],
        [False, True],
    ]


def test_intervals_hold_those_of_another_fit():
    def fit(drag, wind, of_vehicle):
        numbers = tuple(Estimate(name, "1", *each, (0.0, 9.0)) for name, each in (("k_d", drag), ("W_x", wind)))
        return Estimates(np.zeros(0), (numbers,), (Estimate("thrust_scale", "1", *of_vehicle, (-0.9, 3.0)),), ())

    found = fit((1.0, 0.9, 1.1), (2.0, 1.9, 2.1), (0.1, 0.0, 0.2))
    numbers = holding(found, fit((1.3, 1.2, 1.4), (1.7, 1.6, 2.0), (0.5, 0.4, 0.6)))
    assert [(n.value, n.low, n.high) for n in numbers.effects[0]] == [(1.0, 0.9, 1.4), (2.0, 1.6, 2.1)]
    assert numbers.parameters == found.parameters


def test_blocks_of_one_source_are_no_scatter_of_another():
    """Many blocks of the first made a number weak that the second identifies, however well."""
    sources = by_each([0.0, 0.0], np.random.default_rng(3), (2 * BLOCKS, BLOCKS // 2))
    assert [each.numbers.tolist() for each in _strong_together(sources, LAGS)] == [[True, False], [False, True]]


def test_small_effects_by_samples_leave_the_errors_of_all_others_as_they_were(monkeypatch):
    """What stays where a fit found it is as uncertain as before; the small effect has blocks of its own."""
    load = candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.1)
    flights = [weak(fly(1, [(load, [0.06, 0.0, 0.0, 0.6])], seconds=30.0, speed=1.0), force=True)]
    found = fitted(flights, [load], np.full(6, 0.1), GapSettings())
    own = np.array([0.01, 0.02, 0.03])
    without = own + np.random.default_rng(1).normal(0.0, 1e-3, (7, 3))
    asked = []
    monkeypatch.setattr(by_samples, "by_instruments", lambda start, _: asked.append(start) or start)
    by_samples.with_small_effects(
        found, [by_samples.SmallEffect(candidate("torque_bias"), 1e-4, own, without, ())], None
    )
    (start,) = asked
    first, blocks = len(found.estimates.linear), len(found.estimates.left_out)
    assert start.values == pytest.approx(np.insert(found.values, [first] * 3, own))
    of_fit, of_samples = np.split(start.estimates.left_out, [blocks])
    new = first + np.arange(3)
    assert np.ptp(found.estimates.left_out, axis=0).any()
    assert np.delete(of_fit, new, axis=1) == pytest.approx(found.estimates.left_out)
    assert of_samples[:, new] == pytest.approx(without)
    assert not np.ptp(of_fit[:, new], axis=0).any()
    assert not np.ptp(np.delete(of_samples, new, axis=1), axis=0).any()


def test_what_follows_from_others_that_did_not_go_far_is_not_asked_for_again_and_again(monkeypatch):
    """A depth that a small mass turns a short step into a long one of cannot be held: it follows."""
    load = candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.1)
    flights = [weak(fly(1, [(load, [0.06, 0.0, 0.0, 0.6])], seconds=30.0, speed=1.0), force=True)]
    found = fitted(flights, [load], np.full(6, 0.1), GapSettings())
    depth, count = found.values[-1], len(found.values)

    def stepped(at, *_):
        begins = at.values[-1] == depth
        values = at.values + 0.05 * begins * (np.arange(count) == count - 1)
        return values, values + np.outer(np.arange(20.0), begins * 1e-4 * (np.arange(count) == count - 1))

    nothing = [_Source(np.zeros((20, count + 1, count + 1)), np.zeros(count, dtype=bool))]
    monkeypatch.setattr(by_instruments, "_sources", lambda *_: nothing)
    monkeypatch.setattr(by_instruments, "_stepped", stepped)
    assert by_instruments.by_instruments(found, None).values[-1] == pytest.approx(depth + 0.05)


@pytest.mark.parametrize(("name", "least"), [("motor_lag", 0.0), ("vertical_descent", 0.4)])
def test_the_only_number_of_an_effect_may_be_0_and_no_other_shape(name, least):
    effect = CATALOGUE[name]
    assert _ends(effect, effect.shapes[0]) == (least, effect.shapes[0].grid[-1])


def test_what_cannot_be_below_0_and_would_be_is_0(monkeypatch):
    """Of three dampings that instruments move, one would drive the vehicle; the two others are fitted without it."""
    effect = (candidate("linear_damping"), [0.1, 0.1, 0.05])
    found = fitted([weak(fly(1, [effect], gyro=0.005))], [effect[0]], np.ones(6), GapSettings())
    places = np.arange(len(found.estimates.linear))[-3:]
    asked = []

    def stepped(at, sources, *_):
        values = at.values.copy()
        values[places] = np.where(sources[0].numbers[places], [0.08, 0.12, -0.03], values[places])
        # Without one block each moves a little.
        return values, values + 1e-3 * np.eye(len(values))[places] * sources[0].numbers

    def sources(at, _given, held=None):
        numbers = np.isin(np.arange(len(at.values)), places) & ~held
        asked.append(numbers[places].tolist())
        return [_Source(np.zeros((1, len(numbers) + 1, len(numbers) + 1)), numbers)]

    monkeypatch.setattr(by_instruments, "_sources", sources)
    monkeypatch.setattr(by_instruments, "_stepped", stepped)
    after = by_instruments.by_instruments(found, None, together=False)
    assert after.estimates.linear[places] == pytest.approx([0.08, 0.12, 0.0])
    assert [number.name for number in after.estimates.effects[0]] == ["d_x", "d_y"]
    assert asked[0] == [True, True, True]
    assert asked[-1] == [True, True, False]
