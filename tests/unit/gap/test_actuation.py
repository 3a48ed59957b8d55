"""What lies between command and rotors in gusts is what instruments say, and no name where they say nothing."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap import diagnose
from cpfls_cli.gap.naming import actuation
from cpfls_cli.gap.naming.actuation import ActuationFit, decided_by_instruments
from cpfls_cli.gap.naming.by_instruments import unidentified
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, Refusal
from cpfls_cli.gap.naming.held_out import Judgement
from cpfls_cli.gap.naming.results import Alternative, Estimate
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import candidate

LATE = ("motor_lag", "command_delay", "low_pass_filter", "notch_filter")
LAG, DELAY, BOTH = ("motor_lag",), ("command_delay",), ("motor_lag", "command_delay")
BLOCKS = 12
LITTLE = np.tile([1.0, -1.0], BLOCKS // 2)
SURE, ABSENT, OPEN = (0.03, 0.001), (0.001, 0.002), (0.03, 0.04)
GIVEN = SimpleNamespace(flown=[SimpleNamespace(motion=SimpleNamespace(period=0.01))])


def found_with(names, sizes):
    chosen = [candidate(name, **{shape.name: shape.grid[0] for shape in CATALOGUE[name].shapes}) for name in names]
    numbers = [
        tuple(
            Estimate(shape.name, shape.unit, value, value - half, value + half, (shape.grid[0], shape.grid[-1]))
            for shape in each.effect.shapes
        )
        for each, (value, half) in zip(chosen, sizes, strict=True)
    ]
    hypothesis = SimpleNamespace(chosen=tuple(chosen), flights=(), can=lambda _candidate: True)
    estimates = Estimates(
        linear=np.zeros(0), effects=tuple(numbers), parameters=(), of_effect=(np.zeros(0),) * len(numbers)
    )
    return NamedFit(hypothesis, estimates, np.ones(6), GapSettings())


def apart(monkeypatch, own, left, sizes=None):
    """Judge sets that leave so much by block of what was known before, of numbers with half an interval."""
    tried = []

    def fit(_self, names, **_):
        tried.append(names)
        return found_with(names, (sizes or {}).get(names, [SURE] * len(names))) if names in left else None

    monkeypatch.setattr(actuation._Sets, "_fit", fit)
    monkeypatch.setattr(
        actuation,
        "predictable_residual",
        lambda found, *_: left[tuple(each.effect.name for each in found.hypothesis.chosen)] * np.ones(BLOCKS),
    )
    start = found_with(own, [SURE] * len(own))
    result = decided_by_instruments(start, [CATALOGUE[name] for name in (*LATE, "com_offset")], GIVEN)
    names = tuple(each.effect.name for each in result.found.hypothesis.chosen)
    return names, {(each.name, each.instead_of, each.jointly_with) for each in result.alike}, result, tried


@pytest.mark.parametrize("own", [LAG, DELAY, ()], ids=["lag", "delay", "nothing"])
@pytest.mark.parametrize(
    ("together", "names", "rivals"),
    [
        ([SURE, ABSENT], LAG, set()),
        ([ABSENT, SURE], DELAY, {("motor_lag", "command_delay", "")}),
        ([ABSENT, ABSENT], LAG, {("command_delay", "motor_lag", "")}),
        ([OPEN, ABSENT], LAG, {("command_delay", "motor_lag", "")}),
    ],
    ids=["it is the lag", "it is the delay", "the usual one of two", "a lag that may be 0 jointly with a delay"],
)
def test_what_is_needed_next_to_the_other_is_named_whatever_was_found(own, together, names, rivals, monkeypatch):
    left = {(): 90.0, LAG: LITTLE, DELAY: LITTLE[::-1], BOTH: LITTLE}
    found, alike, result, tried = apart(monkeypatch, own, left, {BOTH: together})
    assert (found, alike) == (names, rivals)
    assert result.chances[names[0]] < 1e-6
    # A filter has a number more, and nothing is left for it but the lag that a delay alone lacks.
    assert bool({"low_pass_filter", "notch_filter"} & {*sum(tried, ())}) == (names == DELAY)


FILTER, NOTCH = ("low_pass_filter",), ("notch_filter",)
FILTER_FOR_DELAY, DELAY_FOR_LAG = (("low_pass_filter", "command_delay", ""), ("command_delay", "motor_lag", ""))
ALONE, LATER = {(): 90.0, BOTH: LITTLE, LAG: 9.0, DELAY: LITTLE}, {(): 90.0, BOTH: LITTLE, LAG: 9.0, DELAY: 9.0}
CASES = {
    "where nothing is late nothing trades": (
        (),
        LATER | {(): LITTLE},
        {LAG: [(0.001, 0.05)], DELAY: [(0.001, 0.05)], BOTH: [(0.03, 0.06), (0.02, 0.035)]},
        (),
        None,
    ),
    "the one that leaves more is no rival": (LAG, ALONE, {BOTH: [ABSENT, ABSENT]}, DELAY, set()),
    "a delay with a lag that nothing excludes": (DELAY, ALONE, {BOTH: [OPEN, SURE]}, BOTH, None),
    "a delay with no lag that anybody has": (DELAY, ALONE, {BOTH: [ABSENT, SURE]}, DELAY, None),
    "a lag that is surely not 0, however little is left": (LAG, {(): LITTLE, LAG: LITTLE[::-1]}, {}, LAG, None),
    "each is surely not 0 next to the other, though one alone leaves nothing": (
        LAG, ALONE | {LAG: LITTLE, DELAY: LITTLE[::-1]}, {BOTH: [SURE, SURE]}, BOTH, set(),
    ),
    "what is less than nothing is nothing": (
        LAG, ALONE | {LAG: -2.0}, {BOTH: [ABSENT, ABSENT]}, LAG, {DELAY_FOR_LAG},
    ),
    "what formulas are off by is nothing": (
        LAG, ALONE | {(): 9000.0, DELAY: 1.0}, {BOTH: [ABSENT, ABSENT]}, LAG, {DELAY_FOR_LAG},
    ),
    "a filter that leaves nothing is a rival of one that surely leaves something": (
        DELAY,
        {(): 90.0, DELAY: np.where(np.arange(BLOCKS) < 10, 3.0, -2.0), FILTER: 4.5 * LITTLE + 0.5, NOTCH: 30.0},
        {},
        DELAY,
        {FILTER_FOR_DELAY},
    ),
    "a filter that leaves as little is a rival of a delay without a lag": (
        DELAY, ALONE | {FILTER: LITTLE, NOTCH: 30.0}, {BOTH: [ABSENT, SURE]}, DELAY, {FILTER_FOR_DELAY},
    ),
    "a delay of a third of a sample is none": (LAG, LATER, {BOTH: [SURE, (0.0035, 0.001)]}, LAG, None),
}  # fmt: skip


@pytest.mark.parametrize(("own", "left", "sizes", "names", "rivals"), CASES.values(), ids=CASES)
def test_which_of_lag_delay_and_filter_are_named(own, left, sizes, names, rivals, monkeypatch):
    found, alike, *_ = apart(monkeypatch, own, left, sizes)
    assert (found, alike if rivals is not None else None) == (names, rivals)


@pytest.mark.parametrize(
    ("together", "filtered", "names", "rivals"),
    [
        (SURE, LITTLE, BOTH, {("low_pass_filter", "motor_lag", "")}),
        (SURE, 30.0, BOTH, set()),
        (ABSENT, LITTLE, ("low_pass_filter",), set()),
    ],
    ids=["a filter does what both do", "both", "a filter does what neither does"],
)
def test_more_numbers_are_tried_where_one_leaves_something(together, filtered, names, rivals, monkeypatch):
    left = {(): 90.0, LAG: 30.0, DELAY: 31.0, BOTH: LITTLE, ("low_pass_filter",): filtered, ("notch_filter",): 30.0}
    assert apart(monkeypatch, LAG, left, {BOTH: [together, together]})[:2] == (names, rivals)


def test_one_of_several_that_leaves_less_by_chance_is_a_rival_alone(monkeypatch):
    """Where 7 blocks leave more and none less, p is 0.0078: less than 1 in 100 of one, and not of one of two."""
    some = np.where(np.arange(BLOCKS) < 7, 3.0, 0.0)
    left = {(): 90.0, LAG: 30.0, DELAY: 31.0, BOTH: some, ("low_pass_filter",): 0.0, ("notch_filter",): 30.0}
    names, rivals, *_ = apart(monkeypatch, LAG, left, {BOTH: [SURE, SURE]})
    assert (names, rivals) == (BOTH, {("low_pass_filter", "motor_lag", "")})
    del left[("notch_filter",)]
    assert apart(monkeypatch, LAG, left, {BOTH: [SURE, SURE]})[0] == ("low_pass_filter",)


def test_where_instruments_tell_nothing_or_the_number_may_be_0_nothing_is_named(monkeypatch):
    for left, sizes in (({(): 90.0}, {}), ({(): 90.0, LAG: LITTLE}, {LAG: [ABSENT]})):
        names, rivals, result, _ = apart(monkeypatch, LAG, left, sizes)
        assert (names, rivals, result.chances) == ((), set(), {})


def test_rotors_that_are_measured_are_never_late():
    found = found_with((), [])
    found.hypothesis.can = lambda _candidate: False
    assert decided_by_instruments(found, [CATALOGUE["motor_lag"]], None).found is found


def test_numbers_that_instruments_do_not_tell_are_listed():
    before = found_with(("motor_lag", "command_delay"), [SURE, SURE])
    after = SimpleNamespace(
        hypothesis=before.hypothesis, estimates=SimpleNamespace(effects=[(), *before.estimates.effects[1:]])
    )
    assert [effect.name for effect in unidentified(before, after)] == ["command_delay"]


@pytest.mark.parametrize("unconfirmed", [False, True])
def test_a_lag_that_held_out_flights_do_not_confirm_has_no_rival(unconfirmed, monkeypatch):
    """What instruments name is asked again of these where a fit to all motion says that flights differ."""
    lag, none = found_with(LAG, [SURE]), found_with((), [])
    rival = Alternative("command_delay", "motor_lag", 1.0, "fly steps")
    refusals = [Refusal("motor_lag", "on the held-out flights the gap is as small without it")] * unconfirmed
    last = Judgement(none if unconfirmed else lag, None)
    judge = SimpleNamespace(judge=lambda found: Judgement(found, None), confirmed=lambda _: (last, refusals))
    monkeypatch.setattr(diagnose, "decided_by_instruments", lambda *_: ActuationFit(lag, {"motor_lag": 1e-3}, (rival,)))
    monkeypatch.setattr(diagnose, "differences", lambda *_: ())
    for name in ("by_instruments", "with_lean"):
        monkeypatch.setattr(diagnose, name, lambda found, _: found)
    named = diagnose._Named([], [None], judge, Judgement(lag, None), lag, [], ("the flights differ",))
    judged = diagnose._judged_with_lags(named, None, np.zeros(2))
    assert (judged.differ, judged.refusals) == ((), refusals)
    assert judged.alike == (() if unconfirmed else (rival,))


def test_what_instruments_move_onto_a_bound_without_a_lag_that_goes_is_no_name(monkeypatch):
    """The flights held out do not confirm the lag, and without it nothing is left of another effect."""
    both, other, none = (found_with(names, [SURE] * len(names)) for names in (BOTH, BOTH[1:], ()))
    lag, bound = Refusal(BOTH[0], "the gap is as small without it"), Refusal(BOTH[1], "it would be below 0")
    judge = SimpleNamespace(
        judge=lambda found: Judgement(found, None), confirmed=lambda _: (Judgement(other, None), [lag])
    )
    monkeypatch.setattr(diagnose, "decided_by_instruments", lambda *_: ActuationFit(both, {BOTH[0]: 1e-3}, ()))
    monkeypatch.setattr(diagnose, "differences", lambda *_: ())
    monkeypatch.setattr(diagnose, "ends_on_bound", lambda found: bound if found is other else None)
    monkeypatch.setattr(NamedFit, "without", lambda *_: none)
    for name in ("by_instruments", "with_lean"):
        monkeypatch.setattr(diagnose, name, lambda found, _: found)
    named = diagnose._Named([], [None], judge, Judgement(both, None), both, [], ("the flights differ",))
    judged = diagnose._judged_with_lags(named, None, np.zeros(2))
    assert judged.judgement.found is none
    assert judged.refusals == [lag, bound]
