"""The table of verdicts, and when a gap remains."""

import numpy as np
import pytest

from cpfls_cli.gap.naming.results import Alternative, GapVerdict, Unexplained, gap_remains, verdict_of
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_artifacts import named_effect

RIVAL = Alternative("torque_bias", "com_offset", 0.99, "change the thrust")
LEFT = Unexplained("torque y", 5.2, "yaw rate", 0.8, None, "neither")


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


def test_shares_of_the_settings_decide():
    strict = GapSettings(named_share=0.99, partial_share=0.97)
    assert verdict_of([BIG], [], False, (0.98,), True, strict) is GapVerdict.PARTIAL
    assert verdict_of([BIG], [], False, (0.96,), True, strict) is GapVerdict.UNEXPLAINED


def test_a_gap_that_remains_is_not_all_explained():
    assert verdict_of([BIG], [], True, (0.99,), True, GapSettings()) is GapVerdict.PARTIAL


GONE = np.ones(6)
GAP = np.array([3.0, 20.0, np.nan, np.nan, np.nan, np.nan])


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
