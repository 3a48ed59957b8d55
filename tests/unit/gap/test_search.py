"""The search for effects: what cannot be distinguished, steps of their shapes, and small ones by samples."""

from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.effects.effect import Coefficient, Columns
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.gap.balance import refine
from cpfls_cli.gap.balance.balance_system import System, system
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming import by_samples
from cpfls_cli.gap.naming.ranking import Scored, rank_effects, simplest, unbeaten
from cpfls_cli.gap.naming.search import alternatives
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import candidate, fly, weak

SETTINGS = GapSettings()
NAMES = "linear_damping", "rotor_drag", "torque_bias"
ROUNDED = 1 + np.array([2e-12, 1e-12, 0.0])


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
    known = [weak(fly(seed, [(Candidate(SPECIAL, {}), [0.3])], gyro=0.003, rotor=0.5)) for seed in (1, 2)]
    return rank_effects(known, (), [SPECIAL, TWIN, GENERAL, OTHER], SETTINGS, None)


def of(step, name):
    return next(scored for scored in step.ranking if scored.candidate.effect.name == name)


def rivals(step, own):
    return {each.name: each for each in alternatives(of(step, own), step.ranking, step.above_floor, SETTINGS)}


def test_a_column_that_is_the_same_is_an_alternative_and_a_superset_is_none(step):
    found = rivals(step, "special")
    assert (set(found), found["twin"].instead_of) == ({"twin"}, "special")
    assert (found["twin"].relative_gain, found["twin"].separated_by) == (pytest.approx(1), "fly otherwise")


def test_a_superset_explains_as_much_all_the_same(step):
    assert alternatives(replace(of(step, "special"), gain=-1.0), step.ranking, step.above_floor, SETTINGS) == []
    names = {other.candidate.effect.name for other in unbeaten(of(step, "special"), step.ranking, step.above_floor)}
    assert names == {"twin", "general"}
    assert {"special", "twin"} <= set(rivals(step, "general"))


def test_the_fewest_numbers_win_among_equals(step):
    first = [of(step, name) for name in ("general", "special", "twin", "other")]
    assert simplest(first, step.above_floor, 8.0).candidate.effect.name in ("special", "twin")
    assert simplest([of(step, "general"), of(step, "other")], step.above_floor, 8.0).candidate.effect.name == "general"
    assert "general" in rivals(step, "twin")
    assert "other" not in rivals(step, "special")


def with_errors(name, gain, errors):
    return Scored((Candidate(hand_made(name, (1.3, 0)), {}),), gain, np.asarray(errors, dtype=float), np.ones(1))


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


class Ridge:
    """Squares that fall by next to nothing along steps a thousandth of what the linear system asks for."""

    flights = ()
    vehicle = None
    shapes = (SimpleNamespace(bounds=lambda _vehicle: (-1e9, 1e9)),)
    rotor_wrench = None

    def __init__(self, value, squares, tried):
        self.shape_values, self.squares, self.tried = np.array([value]), squares, tried

    def following(self, _linear):
        return np.array([np.nan])

    def with_shapes(self, values):
        self.tried.append(float(values[0]))
        assert len(self.tried) < 100
        step = abs(values[0] - self.shape_values[0])
        return Ridge(values[0], self.squares - 0.02 if step < 1 else 2e4, self.tried)

    def residual_at(self, _linear):
        return np.array([[np.sqrt(self.squares)]])


def test_a_step_that_has_to_be_a_thousandth_is_none(monkeypatch):
    asked = SimpleNamespace(solve=lambda: np.array([1000.0]), root=(np.eye(1), np.array([30.0])))
    monkeypatch.setattr(refine, "_exact", lambda hypothesis, _weight: hypothesis)
    monkeypatch.setattr(refine, "system", lambda _flights: SimpleNamespace(rotor_wrench=None))
    monkeypatch.setattr(refine, "torque_loss_ratio", lambda _before, _after: 1.0)
    monkeypatch.setattr(refine, "fit_within_bounds", lambda *_: (np.zeros(0), np.zeros(0, dtype=bool)))
    monkeypatch.setattr(refine, "number_columns", lambda *_: np.ones((1, 1, 1)))
    monkeypatch.setattr(refine, "equations", lambda *_: SimpleNamespace(around=lambda *_: asked))
    start = Ridge(0.0, 1e4, [])
    assert refine.refitted(start, np.ones((1, 1))) is start
    assert start.tried[0] == 1000.0


@pytest.mark.parametrize(("mass", "said"), [(0.0, {}), (0.5, {"depth_m": 0.2})])
def test_of_a_load_without_mass_nothing_says_how_deep_its_hook_is(mass, said):
    load = candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.0)
    numbers = {"mass_times_depth": 0.1, "mass": mass}
    linear = [numbers.get(each.name, 0.0) for each in load.effect.coefficients]
    assert load.following(linear, {}) == said


def test_a_load_whose_mass_goes_as_it_is_fitted_keeps_its_hook(monkeypatch):
    said = iter([[np.nan, np.nan, 0.1]])
    monkeypatch.setattr(System, "following", lambda *_: np.array(next(said, [np.nan] * 3)))
    flight = weak(fly(1, gyro=0.02, rotor=2.0))
    start = system([flight], [candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.0)])
    length, _, depth = refine.refitted(start, np.full(6, 1e-4)).shape_values
    assert depth == 0.1
    assert length != 0.52


def test_columns_are_evaluated_again_only_where_their_shape_or_the_signals_change():
    load = candidate("payload", length_m=0.52, damping_1_s=0.1, depth_m=0.0)
    start = system([weak(fly(1))], [candidate("drag_factor_error", error=0.1), candidate("linear_damping"), load])
    error, length, *others = start.shape_values
    damping, pull = (start.columns(each) for each in start.free[1:])
    longer = start.with_shapes(np.array([error, 1.2 * length, *others]))
    assert longer.columns(longer.free[1]) is damping
    assert not np.array_equal(longer.columns(longer.free[2]), pull)
    for moved in (longer, start.with_shapes(np.array([2 * error, length, *others]))):
        alone = system(moved.flights, moved.chosen)
        assert np.array_equal(moved.base, alone.base)
        assert np.array_equal(moved.residual, alone.residual)


@pytest.fixture
def small(monkeypatch):
    """Find the first small effect, with its rivals, by the chance of each and by which ones do without others."""

    def found(chances, unneeded=(), shapes=(), lengths=(900,)):
        def tested(_effect, own, others):
            asked = NAMES[own[0]], *(NAMES[other] for (other,) in others)
            chance = float(asked in unneeded) if others else chances[own[0]]
            return SimpleNamespace(chance=chance, linear=None, without=None)

        def products(candidates):
            places = [np.array([at]) for at in range(len(candidates))]
            return SimpleNamespace(places=places, tested=tested, confirms=lambda _own, known, _linear: not known)

        rows = [np.zeros((own, 6)) for own in lengths]
        sampled = SimpleNamespace(white=None, white_residual=rows, products=products)
        monkeypatch.setattr(by_samples, "_Sampled", lambda *_: sampled)
        each = [Candidate(replace(effect(name), shapes=shapes, order=at), {}) for at, name in enumerate(NAMES)]
        fit = SimpleNamespace(hypothesis=SimpleNamespace(flights=()), settings=GapSettings(significance=0.01))
        named = by_samples.small_effects(fit, (), each, np.ones(6, dtype=bool))
        return [(one.candidate.effect.name, *(rival.name for rival in one.rivals)) for one in named]

    return found


@pytest.mark.parametrize("lengths", [(), (0, 900), (4,), (39, 900)])
def test_a_flight_that_is_shorter_than_a_stretch_shows_no_small_effects(small, lengths):
    assert small([1e-6, 1e-6, 1e-6], lengths=lengths) == []


@pytest.mark.parametrize("rounded", [*permutations(ROUNDED)])
def test_of_equally_sure_ones_the_first_is_chosen(small, rounded):
    assert small(1e-5 * np.array(rounded)) == [NAMES[:1]]


@pytest.mark.parametrize("rounded", [*permutations(ROUNDED)])
def test_of_those_that_replace_each_other_the_first_of_the_catalogue_is_chosen(small, rounded):
    # The second and the third do without each other, the first is less sure.
    assert small(1e-5 * np.array(rounded) * [10, 1, 1], [NAMES[1:], NAMES[:0:-1]]) == [NAMES[1:]]


def test_what_another_one_replaces_is_not_chosen(small):
    assert small([1e-6, 1e-5, 1.0], [NAMES[:2]]) == [NAMES[1:2]]


def test_what_two_others_replace_that_it_does_not_is_not_chosen(small):
    """Inflow damps roll and pitch and rotor drag damps yaw, so that a damping of all three looks surer than each."""
    sure = [1e-9, 1e-6, 1e-5]
    assert small(sure, [NAMES]) == [NAMES[1:2]]
    # It does without one of them, or one of them without it: nobody says which.
    for other in [(NAMES[1], NAMES[2], NAMES[0]), (NAMES[2], NAMES[1], NAMES[0])]:
        assert small(sure, [NAMES, other]) == [NAMES[:1]]


@pytest.mark.parametrize("chances", [[0.02, 0.03, 1.0], [0.005, 0.02, 1.0]])
def test_what_chance_offers_over_all_that_are_tried_is_not_chosen(small, chances):
    assert small(chances) == []


def test_an_effect_with_shapes_is_not_chosen(small):
    assert small([1e-6, 1e-5, 1.0], shapes=effect("motor_lag").shapes) == []
