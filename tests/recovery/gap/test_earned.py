"""Chosen effects that have not earned their names: on a bound, cancelling, harmful, needless, without a lever."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap import diagnose
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit_within_bounds
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.estimate import earned, fitted
from cpfls_cli.gap.naming.held_out import Judge, _bent, differences
from cpfls_cli.gap.naming.ranking import best_floor, rank_effects
from cpfls_cli.gap.settings import VISIBLE, GapSettings
from tests.builders.gap_flights import VEHICLE, candidate, fly, weak

SETTINGS = GapSettings(shifts=99)
ARM = 0.3
OFFSET = (candidate("com_offset"), [0.004, -0.003])
DRAG = (candidate("rotor_drag"), [1.5e-3])


def flights(*effects, seeds=(1, 2), force=False, **given):
    return [weak(fly(seed, effects, gyro=0.005, rotor=1.0, **given), force=force) for seed in seeds]


def kept(found):
    return [each.effect.name for each in found.hypothesis.chosen]


def of(known, *names):
    chosen = [candidate(name) for name in names]
    return earned(known, chosen, best_floor(system(known, chosen)), SETTINGS)


def test_a_damping_that_would_drive_is_held_at_zero():
    """Noise asks for a little of it; a coefficient below its bound is no number to print."""
    known = flights(OFFSET)
    hypothesis = system(known, [candidate("com_offset"), candidate("linear_damping")])
    linear, held = fit_within_bounds(hypothesis, best_floor(hypothesis))
    assert (linear[-3:] >= 0).all()
    assert held[-3:].any() == (linear[-3:] == 0).any()
    found, refusals = of(known, "com_offset", "linear_damping")
    assert kept(found) == ["com_offset"]
    assert not refusals


def test_a_moment_of_a_drag_needs_its_force():
    """The nose goes up with speed, and nothing pushes: no centre of pressure lies that far away."""
    known = flights((candidate("flapping_moment"), [-4e-5]), force=True)
    hypothesis = system(known, [candidate("parasitic_drag")])
    linear, _ = fit_within_bounds(hypothesis, best_floor(hypothesis))
    assert np.abs(linear[-3:]).max() <= 2 * ARM * linear[-6:-3].max() + 1e-12
    # Where no force is known, nothing speaks against it.
    blind = system([weak(flight.signals) for flight in known], [candidate("parasitic_drag")])
    free, _ = fit_within_bounds(blind, best_floor(blind))
    assert np.abs(free[-3:]).max() > 5 * np.abs(linear[-3:]).max()


def test_springs_of_no_frequency_of_their_own_are_no_name():
    own = candidate("flexible_mount", frequency_hz=1.2, damping=0.3)
    known = flights((own, [0.1, 0.1, 0.0]))
    found, refusals = earned(known, [own], best_floor(system(known, [own])), SETTINGS)
    assert kept(found) == []
    assert "frequency and damping may be at the bounds" in refusals[0].sentence


def test_what_is_impossible_takes_nothing_from_what_is_possible(monkeypatch):
    """The search goes on without it, and finds what it took the place of."""
    narrow = replace(CATALOGUE["rotor_drag"].coefficients[0], high=1e-4, scale=None)
    known = flights(DRAG, force=True)
    step = SimpleNamespace(floor=best_floor(system(known, [])))
    offered = [replace(CATALOGUE["rotor_drag"], coefficients=(narrow,)), CATALOGUE["flapping_moment"]]
    monkeypatch.setattr(diagnose, "considered", lambda *_: offered)
    # As where other effects, which go afterwards, held it within its bounds while it was chosen.
    monkeypatch.setattr(diagnose, "forward_selection", lambda _, effects, *__: ([Candidate(effects[0], {})], [step]))
    effects, _, found, (refusal,) = diagnose._searched(known, SETTINGS, np.random.default_rng(0), lambda *_: None)
    assert [effect.name for effect in effects] == kept(found) == ["flapping_moment"]
    assert (refusal.name, refusal.in_the_way) == ("rotor_drag", True)


@pytest.mark.parametrize(
    ("truth", "bounded", "says"),
    [
        ([0.000325, 0.0], 0, "c_x sits on the bound of what is possible, 0.0003 m"),
        ([0.004, 0.0], 0, "c_x would surely be beyond what is possible, 0.0003 m"),
        ([0.02, 0.004], 1, "c_y would surely be beyond what is possible, 0.0003 m"),
    ],
    ids=["on it", "beyond", "the lesser number beyond"],
)
def test_what_would_have_to_be_impossible_is_no_name(truth, bounded, says):
    known = flights((candidate("com_offset"), truth))
    coefficients = list(CATALOGUE["com_offset"].coefficients)
    coefficients[bounded] = replace(coefficients[bounded], low=-0.001, high=0.001)
    chosen = [
        candidate("com_offset")._replace(effect=replace(CATALOGUE["com_offset"], coefficients=coefficients, exact=None))
    ]
    found, (refusal,) = earned(known, chosen, best_floor(system(known, chosen)), SETTINGS)
    assert kept(found) == []
    assert says in refusal.sentence
    assert refusal.in_the_way


def test_a_second_one_is_not_refused_before_others_are_sought_without_the_first():
    known = flights((candidate("com_offset"), [0.004, 0.0]), (candidate("linear_damping"), [0.2, 0.2, 0.1]))
    narrow, chosen = {"com_offset": 0.001, "linear_damping": 0.05}, []
    for name, most in narrow.items():
        bounded = [replace(each, low=-most, high=most) for each in CATALOGUE[name].coefficients]
        chosen.append(Candidate(replace(CATALOGUE[name], coefficients=bounded, exact=None), {}))
    found, (refusal,) = earned(known, chosen, best_floor(system(known, chosen)), SETTINGS)
    assert refusal.in_the_way
    assert kept(found) == [name for name in narrow if name != refusal.name]


def test_a_number_on_its_bound_that_may_be_0_refuses_no_name():
    """Another number shows the effect; the interval of this one is what is possible."""
    coefficients = list(CATALOGUE["com_offset"].coefficients)
    coefficients[1] = replace(coefficients[1], low=-8e-6, high=8e-6, scale=None)
    chosen = [
        candidate("com_offset")._replace(effect=replace(CATALOGUE["com_offset"], coefficients=coefficients, exact=None))
    ]
    known = flights((candidate("com_offset"), [0.004, 1e-5]))
    found, refusals = earned(known, chosen, best_floor(system(known, chosen)), SETTINGS)
    assert (kept(found), refusals) == (["com_offset"], [])
    x, y = found.estimates.effects[0]
    assert x.low < 0.004 < x.high
    assert (y.low, y.value, y.high) == pytest.approx((-8e-6, 8e-6, 8e-6))


def test_two_that_would_have_to_cancel_are_no_names():
    """Two that differ by next to nothing, which is a damping, explain a damping by a difference that nothing allows."""
    known = flights(OFFSET, (candidate("linear_damping"), [0.2, 0.2, 0.1]))
    effect = CATALOGUE["com_offset"]

    def nearly(signals, shape):
        columns = effect.columns(signals, shape)
        moved = columns.direct.copy()
        moved[:, :3] -= 0.1 * signals.body_rate[:, :, None]
        return replace(columns, direct=moved)

    plain = candidate("com_offset")._replace(effect=replace(effect, exact=None))
    twin = plain._replace(effect=replace(effect, name="twin", columns=nearly, exact=None))
    found, refusals = earned(known, [plain, twin], best_floor(system(known, [plain])), SETTINGS)
    assert len(kept(found)) < 2
    assert all("what is possible" in refusal.sentence for refusal in refusals)


def test_what_is_there_next_to_another_is_no_bend_of_it():
    known = flights(DRAG, (candidate("parasitic_drag"), [0.05, 0.05, 0.05, 0.0, 0.0, 0.0]), force=True)
    found, refusals = of(known, "rotor_drag", "parasitic_drag")
    assert kept(found) == ["rotor_drag", "parasitic_drag"]
    assert not refusals


def judge(training, held):
    return Judge(training, held, held, np.random.default_rng(0))


def judged(training, held, *names):
    there = judge(training, held)
    first = there.judge(fitted(training, [candidate(name) for name in names], best_floor(system(training)), SETTINGS))
    last, refusals = there.confirmed(first)
    start = rank_effects(training, (), [CATALOGUE["com_offset"]], SETTINGS, None)
    return last, refusals, differences(first, last, start, there)


def of_another_power(seeds):
    """A drag of the body that grows with the power 1.5 of the speed."""
    drag = candidate("parasitic_drag")

    def columns(signals, shape):
        squared = (signals.air_velocity**2).sum(axis=1)[:, None, None]
        return Columns(drag.effect.columns(signals, shape).direct / (squared + 1e-6) ** 0.25)

    other = drag._replace(effect=replace(drag.effect, columns=columns))
    return flights((other, [0.08, 0.08, 0.08, 0.0, 0.0, 0.0]), seeds=seeds, force=True)


@pytest.mark.parametrize("companion", ["rotor_drag", "inflow"])
def test_what_fills_in_for_the_form_of_another_is_no_name(companion):
    last, (refusal,), _ = judged(of_another_power((1, 2)), of_another_power((3,)), "parasitic_drag", companion)
    assert kept(last.found) == ["parasitic_drag"]
    assert refusal.name == companion


@pytest.mark.parametrize("companion", [("rotor_drag", 1.5e-3), ("inflow", 1e-3)], ids=lambda each: each[0])
@pytest.mark.parametrize("there", [False, True], ids=["another form", "there"])
def test_what_a_bend_of_another_explains_better_is_no_name(companion, there):
    """A drag of the power 1.5 of the speed is not the drags of the powers 1 and 2, which each take a part of it."""
    name, size = companion

    def known(seeds):
        if not there:
            return of_another_power(seeds)
        body = (candidate("parasitic_drag"), [0.05, 0.05, 0.05, 0.0, 0.0, 0.0])
        return flights((candidate(name), [size]), body, seeds=seeds, force=True)

    training = known((1, 2))
    judging, chosen = judge(training, known((3,))), [candidate("parasitic_drag"), candidate(name)]
    first = judging.judge(fitted(training, chosen, best_floor(system(training)), SETTINGS))
    compared = {each.effect.name: judging._without(first, each.effect.name) for each in chosen}
    refusal = _bent(first, compared)
    if there:
        assert refusal is None
    else:
        assert refusal.name == name
        assert "a bend of parasitic drag of the fuselage over speed" in refusal.sentence


def test_what_is_there_stands_and_what_is_not_needed_goes():
    last, refusals, differ = judged(flights(OFFSET), flights(OFFSET, seeds=(3,)), "com_offset", "rotor_drag")
    assert kept(last.found) == ["com_offset"]
    assert [refusal.name for refusal in refusals] == ["rotor_drag"]
    assert not differ


def test_numbers_that_took_up_what_the_others_lack_hide_no_difference():
    """Refitted to flights with a drag, the vehicle's own numbers may leave the others worse than as given."""
    training = flights(DRAG, force=True)
    there = judge(training, flights(seeds=(3,), force=True))
    first = there.judge(fitted(training, [DRAG[0]], best_floor(system(training)), SETTINGS))
    last, _ = there.confirmed(first)
    start = rank_effects(training, (), [CATALOGUE["com_offset"]], SETTINGS, None)
    worse = last._replace(held_out=replace(last.held_out, parameters=2 * last.held_out.parameters))
    assert kept(last.found) == []
    (said,) = differences(first, worse, start, there)
    assert "of what would be rotor drag (H-force), and the held-out flights have none" in said


@pytest.mark.parametrize(("quiet", "loud", "says"), [(1.0, 1.0, True), (0.0, 2.0, False)], ids=["even", "in parts"])
def test_a_gap_that_scatters_beyond_the_difference_of_two_roles_is_none_of_them(quiet, loud, says):
    """Gusts of held-out flights are drawn anew: a gap of 1.6 floors here and one of 1.4 there differ by nothing."""
    training = flights((candidate("com_offset"), [2.5e-4, 0.0]))
    there = judge(training, flights(seeds=(3,)))
    start = rank_effects(training, (), [CATALOGUE["com_offset"]], SETTINGS, None)
    first = there.judge(fitted(training, [], start.floor, SETTINGS))
    held = first.held_out
    halves = np.where(np.arange(len(held.before)) < len(held.before) // 2, quiet, loud)[:, None]
    last = first._replace(held_out=replace(held, before=halves * held.noise, parameters=halves * held.noise))
    assert bool(differences(first, last, start, there)) == says


def test_a_single_block_that_is_held_out_shows_that_flights_differ():
    """Blocks of the others say how much one scatters; the flights learned from have no gap, and 20 floors are one."""
    training = flights()
    there = judge(training, flights(OFFSET, seeds=(3,), seconds=5.0))
    start = rank_effects(training, (), [CATALOGUE["com_offset"]], SETTINGS, None)
    first = there.judge(fitted(training, [], start.floor, SETTINGS))
    assert "the training flights have none" in differences(first, first, start, there)[0]


@pytest.mark.parametrize(
    ("learned", "effects", "seconds", "unknown", "says"),
    [((), (OFFSET,), 8.0, (0.5, slice(3)), True), ((DRAG,), (), 24.0, (1.0, slice(3, 6)), False)],
    ids=["one block of two", "all"],
)
def test_windows_of_held_out_flights_that_do_not_know_a_channel_say_nothing_of_it(
    learned, effects, seconds, unknown, says
):
    """Neither that a gap scatters, between 0 in those and its size in others, nor that there is none."""
    training = flights(*learned, force=True)
    there = judge(training, flights(*effects, seeds=(3,), force=True, seconds=seconds))
    start = rank_effects(training, (), [CATALOGUE["com_offset"]], SETTINGS, None)
    first = there.judge(fitted(training, [], start.floor, SETTINGS))
    known, (share, channels) = first.held_out.known.copy(), unknown
    known[: round(share * len(known)), channels] = False
    last = first._replace(held_out=replace(first.held_out, known=known))
    assert bool(differences(first, last, start, there)) == says


def test_an_axis_that_flights_held_out_hardly_turn_about_makes_nothing_needed():
    """Izz is a fifth too small in the config: the fit shows it, and the flights held out do not by themselves."""
    x, y, z, *products = VEHICLE.inertia_kg_m2
    stated = replace(VEHICLE, inertia_kg_m2=(x, y, 0.8 * z, *products))
    training, held = (
        [weak(replace(fly(seed, (), gyro=0.005, rotor=1.0), vehicle=stated)) for seed in seeds]
        for seeds in ((1, 2), (3,))
    )
    there = judge(training, [replace(each, turns=np.zeros_like(each.turns)) for each in held])
    first = there.judge(fitted(training, [candidate("com_offset")], best_floor(system(training)), SETTINGS))
    without = there._without(first, "com_offset")
    assert np.abs(first.held_out.before[:, 2]).mean() > 2 * np.abs(first.held_out.after[:, 2]).mean()
    assert without.visibly < VISIBLE**2
    assert kept(there.confirmed(first)[0].found) == []


def test_what_makes_a_channel_worse_goes():
    """Drag is in the flights learned from, and the offset in all."""
    last, refusals, _ = judged(flights(OFFSET, DRAG), flights(OFFSET, seeds=(3,)), "com_offset", "rotor_drag")
    assert kept(last.found) == ["com_offset"]
    assert "worse" in refusals[0].sentence


@pytest.mark.parametrize(
    ("training", "held", "says"),
    [((OFFSET,), (), "the held-out flights have none"), ((), (OFFSET,), "the training flights have none")],
    ids=["in training", "held out"],
)
def test_a_gap_in_some_flights_only_is_said(training, held, says):
    names = ("com_offset",) if training else ()
    _, _, (sentence,) = judged(flights(*training), flights(*held, seeds=(3,)), *names)
    assert says in sentence


def test_another_number_in_the_flights_held_out_is_said():
    there, here = [(candidate("com_offset"), [size, 0.0]) for size in (0.004, 0.012)]
    _, _, sentences = judged(flights(there), flights(here, seeds=(3,)), "com_offset")
    assert len(sentences) == 1
    assert sentences[0].startswith("c_x is 0.00")


def test_nothing_hidden_differs_in_nothing():
    for seed in range(3):
        _, _, differ = judged(flights(seeds=(1 + seed, 2 + seed)), flights(seeds=(3 + seed,)))
        assert not differ


def test_a_shape_at_the_end_of_what_is_tried_is_no_name():
    """Sizes that stand in a shape alone."""
    chosen, known = [candidate("ground_effect", G=CATALOGUE["ground_effect"].shapes[0].grid[-1])], []
    for flight in flights():
        low = replace(flight.signals, position=flight.signals.position - [0.0, 0.0, 29.0])
        pull = chosen[0].effect.columns(low, {"G": 30.0}).direct[:, 3:, 0]
        known.append(weak(replace(low, specific_force=low.specific_force + pull / low.vehicle.mass_kg), force=True))
    found, (refusal,) = earned(known, chosen, best_floor(system(known, chosen)), SETTINGS)
    assert kept(found) == []
    assert "its G sits on the bound" in refusal.sentence


def test_a_larger_drag_factor_explains_nothing_by_being_larger():
    """The inertia is free, so that the torque may grow as it likes; what is left stays what it was."""
    step = rank_effects(flights(), (), [CATALOGUE["drag_factor_error"]], SETTINGS, np.random.default_rng(0))
    assert np.median(step.chance) < 0.05 * len(step.hypothesis.residual)


def test_a_height_of_the_mass_that_no_force_shows_is_left_open():
    """What rounding says of a coefficient is no number to print, nor one to fly with."""
    known = flights(OFFSET)
    exact = Candidate(CATALOGUE["com_offset"].exact, {})
    hypothesis = system(known, [exact])
    floor, columns = best_floor(hypothesis), hypothesis.columns(exact).copy()
    for size, seen in ((1e-9, False), (1e-2, True)):
        columns[:, 0, -1] = size * np.sin(np.arange(len(columns)))
        linear, held = fit_within_bounds(replace(hypothesis, cache={exact.key: columns}), floor)
        assert (linear[-1] != 0.0) == seen
        assert held[-1] or seen
        np.testing.assert_allclose(linear[-3:-1], OFFSET[1], atol=3e-4)
