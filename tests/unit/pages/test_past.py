"""What is said of a forecast with the past, beside the same without it."""

from dataclasses import replace

import numpy as np
from cpfls_cli.artifacts.replay import HeldOutGroup
from cpfls_cli.pages.replay import beside_past, errors_table, horizon_figure

from cpfls_cli.playback.history import Observer
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import free_runs, player_of
from cpfls_cli.playback.replay import PREDICTIONS, WITH_PAST, Played, replay
from tests.builders.gusty_flights import SMALL, STORM, Flight, gusty_flights


def test_errors_with_the_past_stand_beside_those_without():
    (flight,) = gusty_flights([Flight(SMALL, STORM)], seconds=6.0)
    player = player_of(VehicleModel(vehicle=SMALL.vehicle), flight)
    known = replace(player, observer=Observer(rate=np.full(6, 20.0), memory_s=np.full(6, 0.5), past_s=0.5))
    pair = Played(flight, player, player, with_past=known)
    found = replay([pair], 20, 5)
    held = HeldOutGroup.judged([pair], found)
    assert held.prediction == (*PREDICTIONS, WITH_PAST)
    runs = free_runs(known, flight, flight.starts(20, 5), 20)
    expected = np.linalg.norm(runs.errors[:, :, 3], axis=2).mean(axis=0)
    np.testing.assert_allclose(held.body_rate.mae[-1], expected)
    (sentence,) = beside_past(held, 0.5)
    smaller = 1 - held.body_rate.total[-1] / held.body_rate.total[0]
    assert f"body rate {100 * smaller:.0f} % smaller" in sentence
    table = errors_table(held, 1)
    assert [row[1] for row in table.rows].count("with the past") == 4
    assert set(held.summary["models"]) == {*PREDICTIONS, WITH_PAST}
    assert len(horizon_figure("errors", held).picture.panels) == 4
