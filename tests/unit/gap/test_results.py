"""The table of verdicts, when a gap remains, and which names the held-out flights leave."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.gap.naming import held_out as unseen
from cpfls_cli.gap.naming.estimate import Refusal
from cpfls_cli.gap.naming.held_out import Judge, Without
from cpfls_cli.gap.naming.results import Alternative, GapVerdict, Unexplained, gap_remains, verdict_of
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_artifacts import named_effect

RIVAL = Alternative("torque_bias", "com_offset", 0.99, "change the thrust")
LEFT = Unexplained("torque y", 5.2, "yaw rate", 0.8, None, "neither")
GONE = np.ones(6)
GAP = np.array([3.0, 20.0, np.nan, np.nan, np.nan, np.nan])
NOTHING = np.zeros(6)


def effect(name="com_offset", share=0.9):
    return named_effect(name, share=share)


BIG, SMALL = effect(), effect("com_offset", 0.05)

CASES = {
    "nothing moved": ([], [], [], 1.0, False, GapVerdict.NOT_EXCITED),
    "nothing wrong": ([], [], [], 1.0, True, GapVerdict.NO_GAP),
    "a gap without a name": ([], [], [LEFT], 1.0, True, GapVerdict.UNEXPLAINED),
    "a gap without a name in a still flight": ([], [], [LEFT], 1.0, False, GapVerdict.UNEXPLAINED),
    "all": ([BIG], [], [], 0.95, True, GapVerdict.NAMED),
    "exactly enough": ([BIG], [], [], 0.9, True, GapVerdict.NAMED),
    "not all": ([BIG], [], [], 0.89, True, GapVerdict.PARTIAL),
    "exactly partly": ([BIG], [], [], 0.5, True, GapVerdict.PARTIAL),
    "too little": ([BIG], [], [], 0.49, True, GapVerdict.UNEXPLAINED),
    "a second cause": ([BIG], [], [LEFT], 0.97, True, GapVerdict.PARTIAL),
    "a rival": ([BIG], [RIVAL], [], 0.95, True, GapVerdict.AMBIGUOUS),
    "a rival of a small part": ([effect("rotor_drag"), SMALL], [RIVAL], [], 0.95, True, GapVerdict.NAMED),
    "a rival of what works against another": (
        [effect("rotor_drag", 1.3), effect("com_offset", -0.3)],
        [RIVAL],
        [],
        0.95,
        True,
        GapVerdict.AMBIGUOUS,
    ),
    "a rival, but not all": ([BIG], [RIVAL], [], 0.7, True, GapVerdict.PARTIAL),
}


@pytest.mark.parametrize(("effects", "rivals", "left", "share", "excited", "expected"), CASES.values(), ids=CASES)
def test_verdicts(effects, rivals, left, share, excited, expected):
    assert verdict_of(effects, rivals, bool(left), (share,), excited, GapSettings()) is expected


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        ((0.98, 0.95), GapVerdict.NAMED),
        ((0.98, 0.1), GapVerdict.PARTIAL),
        ((0.1, 0.98), GapVerdict.PARTIAL),
        ((0.4, 0.3), GapVerdict.UNEXPLAINED),
    ],
)
def test_torque_and_force_are_judged_each(shares, expected):
    """What closes the gap of one is part of the answer, whatever it leaves of the other."""
    assert verdict_of([BIG], [], False, shares, True, GapSettings()) is expected


def test_shares_of_the_settings_decide_and_a_gap_that_remains_is_not_all_explained():
    strict = GapSettings(named_share=0.99, partial_share=0.97)
    assert verdict_of([BIG], [], False, (0.98,), True, strict) is GapVerdict.PARTIAL
    assert verdict_of([BIG], [], False, (0.96,), True, strict) is GapVerdict.UNEXPLAINED
    assert verdict_of([BIG], [], True, (0.99,), True, GapSettings()) is GapVerdict.PARTIAL


@pytest.mark.parametrize(
    ("left", "expected"),
    [
        (LEFT, True),
        (Unexplained("torque y", 3.0, "yaw rate", 0.8, None, "neither"), False),
        (Unexplained("torque y", 5.2, None, 0.0, None, "neither"), False),
        (Unexplained("torque y", 5.2, None, 0.8, 0.9, "feeds"), True),
        (Unexplained("torque y", 5.2, "yaw rate", 0.5, None, "neither"), False),
    ],
    ids=["5.4 % of the gap", "1.8 % of the gap", "follows nothing", "narrow band", "half of it follows"],
)
def test_a_residual_is_a_second_cause_where_it_follows_something_and_is_not_small(left, expected):
    assert gap_remains(GAP, GONE, [left], 0.9, 1) is expected


@pytest.mark.parametrize(("share", "expected"), [(0.06, False), (0.09, True)])
def test_what_follows_a_signal_in_noise_is_a_second_cause_where_it_can_be_seen(share, expected):
    """Of a residual of 1.1 floors 6 % are 0.27 floors, 9 % are 0.33."""
    left = Unexplained("torque y", 1.1, "body rate y", share, None, "feeds")
    assert gap_remains(np.ones(6), GONE, [left], 0.9, 1) is expected


@pytest.mark.parametrize(
    ("before", "after", "remains"),
    [
        ([20.0, 8.0, 1.0], [1.0, 7.0, 1.0], True),
        ([20.0, 8.0, 1.0], [1.0, 2.0, 1.0], False),
        ([1.2, 1.1, 1.0], [1.2, 1.1, 1.0], False),
        ([4.0, 1.0, 1.0], [2.1, 1.0, 1.0], True),
    ],
    ids=["one axis stays", "all shrink", "no clear gap", "a clear rest"],
)
def test_a_gap_remains_where_an_axis_keeps_it(before, after, remains):
    assert gap_remains(np.array(before + [1.0] * 3), np.array(after + [1.0] * 3), [], 0.9, 1) == remains
    assert gap_remains(np.array([9.0] * 3 + before), np.array([1.0] * 3 + after), [], 0.9, 1) == remains


def test_what_several_effects_leave_may_be_what_one_fills_in_for_another():
    before, after = np.array([40.0, 30.0, 1.0, 1.0, 1.0, np.nan]), np.array([1.0, 1.6, 1.0, 1.0, 1.0, np.nan])
    assert [gap_remains(before, after, [], 0.9, effects) for effects in (0, 1, 2)] == [False, False, True]
    assert not gap_remains(before, np.where(after > 1.5, 1.4, after), [], 0.9, 2)


def channel(value, of=0):
    return np.array([value if index == of else 0.0 for index in range(6)])


def refused(raised, after, monkeypatch, beyond=None):
    """Judge effects of which each takes so much off channel 0, where `after` floors are left with all of them.

    A pair is what one takes off and the channel.
    """
    raised = {name: value if isinstance(value, tuple) else (value, 0) for name, value in raised.items()}
    chosen = [SimpleNamespace(effect=SimpleNamespace(name=name)) for name in raised]
    floors = np.full(6, after)
    held_out = SimpleNamespace(after=None, size=lambda _: SimpleNamespace(floors=floors))
    monkeypatch.setattr(unseen, "on_bound", lambda _found: beyond)
    judgement = SimpleNamespace(found=SimpleNamespace(hypothesis=SimpleNamespace(chosen=chosen)), held_out=held_out)
    without = {
        name: Without(channel(*value), NOTHING, np.sqrt(np.maximum(floors**2 + channel(*value), 0.0)))
        for name, value in raised.items()
    }
    monkeypatch.setattr(unseen, "_bent", lambda *_: None)
    monkeypatch.setattr(Judge, "_without", lambda _self, _judgement, name: without[name])
    return Judge([], [], [], np.random.default_rng(0))._refused(judgement)


@pytest.mark.parametrize(
    ("raised", "after", "name"),
    [
        ({"large": 2500.0, "small": 9.0}, 1.1, None),
        ({"large": 2500.0, "small": 9.0}, 2.4, "small"),
        ({"large": 2500.0, "small": 0.4}, 1.1, "small"),
        ({"large": 2500.0, "small": 0.6}, 1.1, None),
        ({"large": 30.0, "small": 0.4}, 1.1, None),
        ({"large": 2500.0, "small": 90.0}, 2.4, None),
        ({"large": 2500.0, "small": 0.05}, 1.1, "small"),
        ({"large": 2500.0, "small": (9.0, 1)}, 2.4, None),
        ({"large": 250000.0, "small": (9.0, 1)}, 2.4, "small"),
        ({"large": 250000.0, "small": (90.0, 1)}, 2.4, None),
        ({"alone": 0.05}, 1.1, "alone"),
        ({"alone": 0.5}, 2.4, None),
        ({"alone": 0.3}, 0.8, "alone"),
        ({"alone": 0.3}, 0.9, None),
        ({"large": 2500.0, "harmful": -3.0}, 2.4, "harmful"),
        ({}, 2.4, None),
    ],
    ids=[
        "small next to a formula that fits", "small next to one that is off", "hardly to be seen next to a large one",
        "to be seen next to a large one", "hardly to be seen next to one that is not much larger", "not so small",
        "needless", "small in a channel of its own", "of second order in a channel of its own",
        "not so small in a channel of its own", "needless alone", "needed", "what is noise without it",
        "what just is not", "harmful", "nothing named",
    ],
)  # fmt: skip
def test_names_stand_that_the_unseen_flights_need(raised, after, name, monkeypatch):
    found = refused(raised, after, monkeypatch)
    assert (found.name if found else None) == name


@pytest.mark.parametrize(("left", "harmed"), [(1.0, True), (5.0, False), (5.6, False)])
def test_what_a_small_effect_does_to_other_channels_is_asked(left, harmed, monkeypatch):
    """With it 5.4 floors are left of a channel: a force that is named has a torque, too."""
    floors = np.array([5.4, *np.ones(5)])
    before = SimpleNamespace(found=None, held_out=SimpleNamespace(after=None))
    after = SimpleNamespace(held_out=SimpleNamespace(after=None, size=lambda _: SimpleNamespace(floors=floors)))
    without = Without(channel(left**2 - 5.4**2), NOTHING, np.array([left, *np.ones(5)]))
    monkeypatch.setattr(Judge, "_compared", lambda *_: without)
    assert Judge([], [], [], np.random.default_rng(0)).harmed(after, before) is harmed


def test_what_the_others_held_within_bounds_goes_without_them(monkeypatch):
    """However much of the gap it takes off: next to those that are left its number is impossible."""
    impossible = Refusal("large", "its c_z would surely be beyond what is possible", True)
    assert refused({"large": 2500.0, "small": 90.0}, 1.1, monkeypatch, beyond=impossible).name == "large"


def test_what_no_flight_learned_from_shows_is_no_difference_between_flights():
    held_out = SimpleNamespace(unlearned={"vertical_descent": 0.2}, shares=lambda: {"force": 0.5})
    found = SimpleNamespace(hypothesis=SimpleNamespace(chosen=[None]), estimates=None, settings=GapSettings())
    # Nothing else is asked for: no step, no judge.
    first = SimpleNamespace(found=found, held_out=held_out)
    assert unseen.differences(first, first, None, None) == ()
