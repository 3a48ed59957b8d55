"""What lies between command and rotors in gusts is what instruments say, and no name where they say nothing."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming import by_instruments
from cpfls_cli.gap.naming.by_instruments import told_apart, untold, untold_actuation
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import candidate

LATE = ("motor_lag", "command_delay", "low_pass_filter", "notch_filter")
BLOCKS = 12
LITTLE = np.tile([1.0, -1.0], BLOCKS // 2)


def found_with(*chosen):
    hypothesis = SimpleNamespace(chosen=tuple(chosen), flights=())
    return SimpleNamespace(hypothesis=hypothesis, estimates=SimpleNamespace(effects=[object() for _ in chosen]))


def apart(monkeypatch, *own, beside=None, **left):
    """Judge effects that leave so much, block by block, of what instruments know; sets of them by all their names."""
    tried = []

    def rank(_flights, others, effects, *_args, **_kwargs):
        (effect,) = effects
        tried.append(effect.name)
        shape = {shape.name: shape.grid[0] for shape in effect.shapes}
        return SimpleNamespace(ranking=[SimpleNamespace(chosen=(*others, candidate(effect.name, **shape)))])

    monkeypatch.setattr(by_instruments, "rank_effects", rank)
    monkeypatch.setattr(by_instruments, "refined", lambda _flights, chosen, _floor: SimpleNamespace(chosen=chosen))
    monkeypatch.setattr(by_instruments, "fitted", lambda _flights, chosen, *_: found_with(*chosen))
    monkeypatch.setattr(by_instruments, "by_instruments", lambda found, *_: found)
    names = lambda found: {each.effect.name for each in found.hypothesis.chosen}  # noqa: E731
    monkeypatch.setattr(
        by_instruments,
        "_reproduced",
        lambda found, *_: left["_and_".join(each for each in LATE if each in names(found))] * np.ones(BLOCKS),
    )
    late = (candidate(name, **{s.name: s.grid[0] for s in CATALOGUE[name].shapes}) for name in own)
    start = found_with(beside or candidate("com_offset"), *late)
    effects = [CATALOGUE[name] for name in (*LATE, "com_offset")]
    found, rivals = told_apart(start, effects, None, np.ones(6), GapSettings())
    return names(found) - {"com_offset"}, {(each.name, each.instead_of) for each in rivals}, tried


@pytest.mark.parametrize(
    ("own", "lag", "delay", "name", "rivals"),
    [
        ("command_delay", LITTLE, 9.0, "motor_lag", set()),
        ("motor_lag", 9.0, LITTLE, "command_delay", set()),
        ("command_delay", LITTLE, LITTLE[::-1], "motor_lag", {("command_delay", "motor_lag")}),
        ("motor_lag", LITTLE, LITTLE[::-1], "motor_lag", {("command_delay", "motor_lag")}),
    ],
    ids=["it is the lag", "it is the delay", "the usual one of two", "the other one is a rival"],
)
def test_what_leaves_nothing_that_instruments_know_is_named(own, lag, delay, name, rivals, monkeypatch):
    found, alike, tried = apart(monkeypatch, own, motor_lag=lag, command_delay=delay)
    assert (found, alike) == ({name}, rivals)
    # A filter has a number more.
    assert not {"low_pass_filter", "notch_filter"} & set(tried)


@pytest.mark.parametrize(
    ("both", "filtered", "names", "rivals"),
    [
        (LITTLE, LITTLE[::-1], {"low_pass_filter"}, set()),
        (LITTLE, 9.0, {"command_delay", "notch_filter"}, set()),
    ],
    ids=["one does what both do", "both are needed"],
)
def test_one_effect_takes_the_place_of_two_that_leave_no_less(both, filtered, names, rivals, monkeypatch):
    left = {"motor_lag": 9.0, "command_delay": 9.0, "notch_filter": 9.0, "low_pass_filter": filtered}
    found, alike, _ = apart(monkeypatch, "notch_filter", "command_delay", **left, command_delay_and_notch_filter=both)
    assert (found, alike) == (names, rivals)


def test_an_effect_on_the_actuation_that_instruments_do_not_tell_is_what_a_loop_does_too():
    before = found_with(candidate("channel_delay", delay_s=0.03), candidate("com_offset"))
    assert untold_actuation(before, before) == ["channel_delay"]
    assert [effect.name for effect in untold(before, before)] == ["channel_delay", "com_offset"]
    told = found_with(*before.hypothesis.chosen)
    assert untold_actuation(before, told) == untold(before, told) == []


def test_a_supply_that_sinks_is_no_loop_and_what_is_late_is_told_beside_it(monkeypatch):
    before = found_with(candidate("battery_sag", exponent=2.0), candidate("motor_lag", time_constant_s=0.03))
    assert untold_actuation(before, before) == ["motor_lag"]
    left = {"motor_lag": LITTLE, "command_delay": 9.0}
    found, _, _ = apart(monkeypatch, "command_delay", **left, beside=candidate("battery_sag", exponent=2.0))
    assert found == {"battery_sag", "motor_lag"}
