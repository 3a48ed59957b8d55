"""The surest of small effects: those that replace each other are rivals, and rounding decides between none."""

from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.effects.registry import effect
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming import by_samples
from cpfls_cli.gap.naming.by_samples import _surest, _Test, _Tried

NAMES = "linear_damping", "rotor_drag", "torque_bias"
ROUNDED = 1 + np.array([2e-12, 1e-12, 0.0])


class Learned:
    """Answers which of two does without the other."""

    def __init__(self, unneeded):
        self.unneeded = unneeded

    def tested(self, _effect, own, others):
        ((other,),) = others
        return _Test(float((NAMES[own[0]], NAMES[other]) in self.unneeded), *[np.zeros(1)] * 3)


def tried(chances, shapes=()):
    each = [replace(effect(name), shapes=shapes, order=place) for place, name in enumerate(NAMES)]
    tests = [_Test(chance, *[np.zeros(1)] * 3) for chance in chances]
    return [
        _Tried(Candidate(own, {}), np.array([at]), test) for at, (own, test) in enumerate(zip(each, tests, strict=True))
    ]


def chosen(unneeded, tried):
    best, rivals = _surest(Learned(unneeded), tried, [], 0.01)
    return best and best.candidate.effect.name, [each.name for each in rivals]


@pytest.mark.parametrize("lengths", [(), (0, 900), (4,), (39, 900)])
def test_a_flight_that_is_shorter_than_a_stretch_shows_no_small_effects(monkeypatch, lengths):
    sampled = SimpleNamespace(white=None, white_residual=[np.zeros((own, 6)) for own in lengths])
    monkeypatch.setattr(by_samples, "_Sampled", lambda *_: sampled)
    found = SimpleNamespace(hypothesis=SimpleNamespace(flights=()))
    assert by_samples.small_effects(found, (), (), np.ones(6, dtype=bool)) == []


@pytest.mark.parametrize("rounded", [*permutations(ROUNDED)])
def test_of_equally_sure_ones_the_first_is_chosen(rounded):
    assert chosen((), tried(1e-5 * np.array(rounded))) == (NAMES[0], [])


@pytest.mark.parametrize("rounded", [*permutations(ROUNDED)])
def test_of_those_that_replace_each_other_the_first_of_the_catalogue_is_chosen(rounded):
    # The second and the third do without each other, the first is less sure.
    both = [NAMES[1:], NAMES[:0:-1]]
    assert chosen(both, tried(1e-5 * np.array(rounded) * [10, 1, 1])) == (NAMES[1], [NAMES[2]])


def test_what_another_one_replaces_is_not_chosen():
    assert chosen([NAMES[:2]], tried([1e-6, 1e-5, 1.0])) == (NAMES[1], [])


@pytest.mark.parametrize("chances", [[0.02, 0.03, 1.0], [0.005, 0.02, 1.0]])
def test_what_chance_offers_over_all_that_are_tried_is_not_chosen(chances):
    assert chosen((), tried(chances)) == (None, [])


def test_an_effect_with_shapes_is_not_chosen():
    assert chosen((), tried([1e-6, 1e-5, 1.0], shapes=effect("motor_lag").shapes)) == (None, [])
