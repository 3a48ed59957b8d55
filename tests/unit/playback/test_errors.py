"""To which horizon a model is better than what knows no model."""

from dataclasses import dataclass

import numpy as np
import pytest

from cpfls_cli.playback.errors import MODEL, ByHorizon, Errors, Prediction
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import player_of, still_runs
from cpfls_cli.playback.replay import Played, fading, replay
from cpfls_cli.validation.trust import GOOD, Trust, trust_by_playback
from tests.builders.gusty_flights import SMALL, STORM, Flight, gusty_flights

HORIZON = np.array([0.1, 0.2, 0.3, 0.4])
PREDICTION = ("model", "nothing-moves", "rate-stays", "stated")
FADES = (*PREDICTION, "rate-fades")
NOTHING, STAYS, STATED = [1.0, 2.0, 3.0, 4.0], [2.0, 2.0, 2.0, 2.0], [9.0] * 4


def errors_of(horizon, **signals):
    """Errors by horizon of predictions by name, those of each signal given as mean norms and perhaps their chance."""

    def own(rows, name):
        mae, chance = rows[name] if isinstance(rows[name], tuple) else (rows[name], None)
        mae = np.broadcast_to(np.asarray(mae, dtype=float), horizon.shape)
        return Errors(mae=mae, rms_by_axis=np.zeros((len(horizon), 3)), chance=chance)

    names = next(iter(signals.values()))
    known = {"body_rate": dict.fromkeys(names, 1.0), **signals}
    models = {
        name: Prediction(diverged=0, **{signal: own(rows, name) for signal, rows in known.items()}) for name in names
    }
    return ByHorizon(horizon_s=horizon, models=models)


@pytest.mark.parametrize(
    ("model", "horizon"),
    [
        ([0.5, 0.5, 0.5, 0.5], 0.4),
        # Worse at the first sample, better over all.
        ([1.1, 1.0, 1.0, 1.0], 0.4),
        # "nothing moves" adds up to 1, 3, 6, 10 and "rate stays" to 2, 4, 6, 8: the better of both counts.
        ([0.5, 0.5, 0.5, 6.6], 0.3),
        ([1.5, 2.0, 3.0, 4.0], 0.0),
    ],
)
def test_sums_up_to_a_horizon_are_compared(model, horizon):
    errors = errors_of(HORIZON, body_rate=dict(zip(PREDICTION, (model, NOTHING, STAYS, STATED), strict=True)))
    assert errors.better_to("body_rate") == horizon
    assert np.isnan(errors.better_to("velocity"))


def held_out(rate, attitude=None, velocity=None, chance=None, names=FADES):
    """Errors from 0.02 to 0.5 s; all rivals grow from 0 to 1."""
    horizon = np.linspace(0.02, 0.5, 25)
    within = None if chance is None else np.full(25, chance)

    def rows(model):
        known = zip(names, (model(horizon), 2 * horizon, 2 * horizon, horizon, 2 * horizon), strict=False)
        return {name: (mae, within if name != MODEL or within is None else np.zeros(25)) for name, mae in known}

    known = {"body_rate": rate, "attitude": attitude, "velocity": velocity}
    return errors_of(horizon, **{name: rows(model) for name, model in known.items() if model is not None})


def good(horizon):
    return horizon


def slow(horizon):
    """Better than its rivals over half a second, and worse from 0.04 to 0.1 s."""
    return np.where((horizon > 0.03) & (horizon < 0.11), 2.5 * horizon, 0.5 * horizon)


def late(horizon):
    return np.where(horizon > 0.3, 2.01 * horizon, horizon)


@pytest.mark.parametrize(
    ("given", "trust"),
    [
        ((good, good, good), Trust.SIMULATION),
        ((good, good), Trust.CONTROL),
        # A loss beyond what a controller corrects is none.
        ((good, late, good), Trust.SIMULATION),
        ((slow, good, good), Trust.NOT_CONTROL),
        ((good, slow, good), Trust.NOT_CONTROL),
        # What nobody controls by.
        ((good, good, slow), Trust.SIMULATION),
        ((lambda horizon: 3 * horizon, good, good), Trust.DO_NOT_USE),
        # Its rates merely fade, and nothing of it moves as the vehicle does.
        ((good, good, lambda horizon: 2.1 * horizon), Trust.NOT_CONTROL),
    ],
)
def test_nothing_is_good_for_control_that_loses_where_control_lives(given, trust):
    assert trust_by_playback(held_out(*given)) == trust


def decays(horizon):
    """Better than what fades at first, and hardly where what knows no torque has forgotten most."""
    return np.where(horizon < 0.2, 1.8, 1.92) * horizon


@pytest.mark.parametrize(
    ("rate", "chance", "trust"),
    [
        # Half of the interval of a difference that is 0.05 to 0.125 from 0.1 to 0.25 s.
        (slow, 0.06, Trust.CONTROL),
        (slow, 0.01, Trust.NOT_CONTROL),
        (slow, None, Trust.NOT_CONTROL),
        (decays, None, Trust.NOT_CONTROL),
        (lambda horizon: 1.8 * horizon, None, Trust.CONTROL),
        # At 0.24 s it is better by 0.048.
        (lambda horizon: 1.8 * horizon, 0.04, Trust.CONTROL),
        (lambda horizon: 1.8 * horizon, 0.05, Trust.NOT_CONTROL),
    ],
)
def test_a_loss_is_one_beyond_chance_and_so_is_what_is_better_than_mere_decay(rate, chance, trust):
    assert trust_by_playback(held_out(rate, good, chance=chance)) == trust


def test_files_that_do_not_know_how_rates_fade_are_judged_without_it():
    before = held_out(decays, good, names=PREDICTION)
    assert held_out(decays, good).like_fading() == pytest.approx(0.24)
    assert before.like_fading() is None
    assert trust_by_playback(before) == Trust.CONTROL


@pytest.mark.parametrize(("model", "behind"), [(0.9, ()), (1.5, ()), (2.1, ("position",))])
def test_motion_is_behind_only_where_both_rivals_are_better(model, behind):
    rows = dict(zip(PREDICTION, (model, 1.0, 2.0, STATED), strict=True))
    assert errors_of(HORIZON, position=rows).behind_both() == behind


def test_a_loss_is_named_with_its_rival_and_horizons():
    lost = held_out(slow, good).lost_to()
    assert list(lost) == ["body_rate"]
    assert lost["body_rate"] == ("nothing-moves", pytest.approx(0.04), pytest.approx(0.1))


def test_predictions_are_found_by_their_names():
    """Whatever the order in which a file holds them."""
    mixed = ("with-past", "stated", "rate-stays", "model", "nothing-moves")
    rows = {"model": good(HORIZON), "nothing-moves": 3 * HORIZON, "rate-stays": 2 * HORIZON}
    errors = errors_of(HORIZON, body_rate={name: rows.get(name, 9 * HORIZON) for name in mixed})
    assert (errors.rival("body_rate"), errors.better_to("body_rate")) == ("rate-stays", 0.4)


@dataclass(frozen=True)
class Decaying(Played):
    """A model whose rates decay, whatever the rotors do, but which knows a share of what is then missed."""

    knows_share: float = 0.0

    def runs(self, prediction, starts, horizon):
        runs = super().runs(prediction, starts, horizon)
        if prediction != MODEL:
            return runs
        decayed = still_runs(self.flight, starts, horizon, moves=True, fading_s=1.1 * self.fading_s)
        return runs._replace(errors=(1 - self.knows_share) * decayed.errors)


def test_a_model_of_mere_decay_is_not_good_whatever_else_it_beats():
    training, held = gusty_flights([Flight(SMALL, STORM), Flight(SMALL, STORM, draw=1)], seconds=8.0)
    player, fading_s = player_of(VehicleModel(vehicle=SMALL.vehicle), held), fading([training], 50)

    def judged(knows_share):
        pair = Decaying(held, player, player, knows_share=knows_share, fading_s=fading_s)
        return replay([pair], 50, 10).along([pair])

    found, better = judged(0.0), judged(0.5)
    assert found.model.body_rate.chance is not None
    assert found.like_fading() == pytest.approx(0.25)
    assert better.like_fading() is None
    assert (trust_by_playback(found) in GOOD, trust_by_playback(better) in GOOD) == (False, True)
