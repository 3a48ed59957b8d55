"""What cannot be distinguished, on a system of hand-made effects."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.effect import Coefficient, Columns
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.odds import simplest, unbeaten
from cpfls_cli.gap.naming.ranking import Scored, rank_effects
from cpfls_cli.gap.naming.search import alternatives
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import fly, weak

SETTINGS = GapSettings()


def hand_made(name, *directions):
    """Torques that follow sines of the time; each direction is a frequency in rad/s and an axis."""

    def columns(signals, _shape):
        direct = np.zeros((len(signals), 6, len(directions)))
        for number, (frequency, axis) in enumerate(directions):
            direct[:, axis, number] = np.sin(frequency * signals.time)
        return Columns(direct)

    coefficients = tuple(Coefficient(f"c{n}", "N m", -1.0, 1.0, "size") for n in range(len(directions)))
    model = CATALOGUE["torque_bias"]
    return replace(model, name=name, coefficients=coefficients, columns=columns, rivals={"special": "fly otherwise"})


SPECIAL = hand_made("special", (1.3, 0))
TWIN = hand_made("twin", (1.3, 0))
GENERAL = replace(hand_made("general", (1.3, 0), (2.1, 1)), holds=frozenset({"special"}))
OTHER = hand_made("other", (2.9, 0))


@pytest.fixture(scope="module")
def step():
    known = []
    for seed in (1, 2):
        signals = fly(seed, [(Candidate(SPECIAL, {}), [0.3])], gyro=0.003, rotor=0.5)
        known.append(weak(signals))
    return rank_effects(known, (), [SPECIAL, TWIN, GENERAL, OTHER], SETTINGS, None)


def of(step, name):
    return next(scored for scored in step.ranking if scored.candidate.effect.name == name)


def rivals(step, own):
    found = alternatives(of(step, own), step.ranking, step.above_floor, SETTINGS)
    return {each.name: each for each in found}


def test_a_column_that_is_the_same_is_an_alternative_and_a_superset_is_none(step):
    found = rivals(step, "special")
    assert set(found) == {"twin"}
    assert found["twin"].instead_of == "special"
    assert found["twin"].relative_gain == pytest.approx(1)
    assert found["twin"].separated_by == "fly otherwise"


def test_a_superset_explains_as_much_all_the_same(step):
    names = {other.candidate.effect.name for other in unbeaten(of(step, "special"), step.ranking, step.above_floor)}
    assert names == {"twin", "general"}


def test_the_special_case_is_an_alternative_of_its_superset(step):
    assert {"special", "twin"} <= set(rivals(step, "general"))


def test_the_fewest_numbers_win_among_equals(step):
    first = [of(step, name) for name in ("general", "special", "twin", "other")]
    assert simplest(first, step.above_floor, 8.0).candidate.effect.name in ("special", "twin")
    assert simplest([of(step, "general"), of(step, "other")], step.above_floor, 8.0).candidate.effect.name == "general"


def test_more_numbers_alone_make_no_superset(step):
    assert "general" in rivals(step, "twin")


def test_an_effect_with_next_to_no_gain_is_no_alternative(step):
    assert "other" not in rivals(step, "special")


def with_errors(name, gain, errors):
    effect = hand_made(name, (1.3, 0))
    return Scored((Candidate(effect, {}),), gain, np.asarray(errors, dtype=float), np.ones(1))


BLOCKS = 12
OWN = with_errors("own", 1000.0, np.full(BLOCKS, 100.0))


@pytest.mark.parametrize(
    ("more", "beaten"),
    [
        (np.full(BLOCKS, 20.0), True),
        (20.0 * (-1.0) ** np.arange(BLOCKS), False),
        (np.r_[240.0, np.zeros(BLOCKS - 1)], False),
        (np.full(BLOCKS, 0.01), False),
    ],
    ids=["everywhere", "to and fro", "one block only", "next to nothing"],
)
def test_beaten_is_who_leaves_more_in_most_blocks(more, beaten):
    other = with_errors("other", 760.0, OWN.block_error + more)
    assert (other not in unbeaten(OWN, [OWN, other], 1000.0)) == beaten


def test_one_block_cannot_tell():
    alone = with_errors("own", 100.0, [10.0])
    assert unbeaten(alone, [alone, with_errors("other", 90.0, [30.0])], 100.0)


@pytest.mark.parametrize(("less", "wins"), [(0.5, "one number"), (2.5, "two numbers")])
def test_a_number_more_has_to_explain_something(less, wins):
    """Eight squared floors; six more are none, however certain they were."""
    to_and_fro = 20.0 * (-1.0) ** np.arange(BLOCKS)
    two = Scored((Candidate(replace(GENERAL, name="two numbers"), {}),), 100.0, OWN.block_error, np.ones(2))
    one = with_errors("one number", 100.0 - BLOCKS * less, OWN.block_error + to_and_fro + less)
    assert simplest([two, one], 100.0, 8.0).candidate.effect.name == wins


@pytest.mark.parametrize(("less", "wins"), [(0.5, "usual"), (1.0, "best")])
def test_what_no_number_separates_is_what_is_usual(less, wins):
    to_and_fro = 20.0 * (-1.0) ** np.arange(BLOCKS)
    best = with_errors("best", 1e4, OWN.block_error)
    effect = replace(hand_made("usual", (1.3, 0)), order=SPECIAL.order - 1)
    gain, errors = 1e4 - BLOCKS * less, OWN.block_error + to_and_fro + less
    usual = Scored((Candidate(effect, {}),), gain, errors, np.ones(1))
    assert simplest([best, usual], 1e4, 8.0).candidate.effect.name == wins


def test_systems_without_flights_of_the_signal_have_no_columns():
    assert system([weak(fly(1))]).columns(Candidate(CATALOGUE["battery_sag"], {"exponent": 1.0})).shape[2] == 0
