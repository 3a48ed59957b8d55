"""What the held-out flights say of each effect decides which names stand."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.gap.naming import held_out as unseen
from cpfls_cli.gap.naming.estimate import Refusal
from cpfls_cli.gap.naming.held_out import Judge, Without
from cpfls_cli.gap.settings import GapSettings

NOTHING = np.zeros(6)


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
    found = SimpleNamespace(hypothesis=SimpleNamespace(chosen=chosen))
    judgement = SimpleNamespace(found=found, held_out=held_out)
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
        "small beside a formula that fits",
        "small beside one that is off",
        "hardly to be seen beside a large one",
        "to be seen beside a large one",
        "hardly to be seen beside one that is not much larger",
        "not so small",
        "needless",
        "small in a channel of its own",
        "of second order in a channel of its own",
        "not so small in a channel of its own",
        "needless alone",
        "needed",
        "what is noise without it",
        "what just is not",
        "harmful",
        "nothing named",
    ],
)
def test_names_stand_that_the_unseen_flights_need(raised, after, name, monkeypatch):
    found = refused(raised, after, monkeypatch)
    assert (found.name if found else None) == name


def test_what_the_others_held_within_bounds_goes_without_them(monkeypatch):
    """However much of the gap it takes off: next to those that are left its number is impossible."""
    impossible = Refusal("large", "its c_z would surely be beyond what is possible", True)
    assert refused({"large": 2500.0, "small": 90.0}, 1.1, monkeypatch, beyond=impossible).name == "large"


def test_what_no_flight_learned_from_shows_is_no_difference_between_flights():
    held_out = SimpleNamespace(unlearned={"vertical_descent": 0.2}, shares=lambda: {"force": 0.5})
    found = SimpleNamespace(hypothesis=SimpleNamespace(chosen=[None]), estimates=None, settings=GapSettings())
    # Nothing else is asked for: no step, no judge.
    assert unseen._other_numbers(SimpleNamespace(found=found, held_out=held_out), None) == ()
