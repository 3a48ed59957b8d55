"""To which horizon a model is better than what knows no model."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from cpfls_cli.artifacts.replay import (
    HeldOutGroup,
    SignalErrorGroup,
    behind_both,
    better_to,
    like_fading,
    lost_to,
    rival_row,
    trust_by_playback,
)

from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import player_of, still_runs
from cpfls_cli.playback.replay import MODEL, Played, fading, replay
from cpfls_cli.validation.trust import GOOD, Trust
from tests.builders.gusty_flights import SMALL, STORM, Flight, gusty_flights

HORIZON = np.array([0.1, 0.2, 0.3, 0.4])
PREDICTION = ("model", "nothing-moves", "rate-stays", "stated")
FADES = (*PREDICTION, "rate-fades")
NOTHING, STAYS, STATED = [1.0, 2.0, 3.0, 4.0], [2.0, 2.0, 2.0, 2.0], [9.0] * 4


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
    group = SignalErrorGroup(mae=np.array([model, NOTHING, STAYS, STATED]), rms=np.zeros((4, 4, 3)))
    errors = SimpleNamespace(horizon_s=HORIZON, errors={"body_rate": group, "velocity": None}, prediction=PREDICTION)
    assert better_to(errors, "body_rate") == horizon
    assert np.isnan(better_to(errors, "velocity"))


def held_out(rate, attitude=None, velocity=None, chance=None):
    """Errors from 0.02 to 0.5 s; all rivals grow from 0 to 1."""
    horizon = np.linspace(0.02, 0.5, 25)

    def group(model):
        rows = [np.broadcast_to(model, horizon.shape), 2 * horizon, 2 * horizon, horizon, 2 * horizon]
        within = None if chance is None else np.vstack([np.zeros(25), np.full((4, 25), chance)])
        return SignalErrorGroup(mae=np.array(rows), rms=np.zeros((5, 25, 3)), chance=within)

    known = {"body_rate": rate, "attitude": attitude, "velocity": velocity, "position": None}
    errors = {name: None if model is None else group(model(horizon)) for name, model in known.items()}
    return SimpleNamespace(horizon_s=horizon, errors=errors, prediction=FADES)


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
    errors = held_out(decays, good)
    before = SimpleNamespace(
        horizon_s=errors.horizon_s,
        prediction=PREDICTION,
        errors={
            name: group and SignalErrorGroup(mae=group.mae[:4], rms=group.rms[:4])
            for name, group in errors.errors.items()
        },
    )
    assert like_fading(errors) == pytest.approx(0.24)
    assert like_fading(before) is None
    assert trust_by_playback(before) == Trust.CONTROL


@pytest.mark.parametrize(("model", "behind"), [(0.9, ()), (1.5, ()), (2.1, ("position",))])
def test_motion_is_behind_only_where_both_rivals_are_better(model, behind):
    rows = np.array([4 * [model], 4 * [1.0], 4 * [2.0], STATED])
    group = SignalErrorGroup(mae=rows, rms=np.zeros((4, 4, 3)))
    errors = SimpleNamespace(horizon_s=HORIZON, errors={"velocity": None, "position": group}, prediction=PREDICTION)
    assert behind_both(errors) == behind


def test_a_loss_is_named_with_its_rival_and_horizons():
    lost = lost_to(held_out(slow, good))
    assert list(lost) == ["body_rate"]
    assert lost["body_rate"] == ("nothing-moves", pytest.approx(0.04), pytest.approx(0.1))


def test_rows_are_found_by_their_names():
    """Whatever the order in which a file holds them."""
    mixed = ("with-past", "stated", "rate-stays", "model", "nothing-moves")
    rows = {"model": good(HORIZON), "nothing-moves": 3 * HORIZON, "rate-stays": 2 * HORIZON}
    mae = np.array([rows.get(name, 9 * HORIZON) for name in mixed])
    group = SignalErrorGroup(mae=mae, rms=np.zeros((5, 4, 3)))
    errors = SimpleNamespace(horizon_s=HORIZON, errors={"body_rate": group}, prediction=mixed)
    assert rival_row(errors, group) == mixed.index("rate-stays")
    assert better_to(errors, "body_rate") == 0.4


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
        return HeldOutGroup.judged([pair], replay([pair], 50, 10))

    found, better = judged(0.0), judged(0.5)
    assert found.body_rate.chance is not None
    assert like_fading(found) == pytest.approx(0.25)
    assert like_fading(better) is None
    assert (trust_by_playback(found) in GOOD, trust_by_playback(better) in GOOD) == (False, True)
