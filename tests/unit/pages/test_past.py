"""What is said of a forecast with the past, beside the same without it."""

import re
from dataclasses import replace

import numpy as np

from cpfls_cli.playback.errors import PREDICTIONS, WITH_PAST
from cpfls_cli.playback.history import Observer
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import free_runs, player_of
from cpfls_cli.playback.replay import Played, replay
from cpfls_cli.stages.vehicle import vehicle as stage
from tests.builders.gusty_flights import SMALL, STORM, Flight, gusty_flights
from tests.builders.vehicle_models import source_of_vehicle, vehicle_of, whole


def test_errors_with_the_past_stand_beside_those_without():
    (flight,) = gusty_flights([Flight(SMALL, STORM)], seconds=6.0)
    player = player_of(VehicleModel(vehicle=SMALL.vehicle), flight)
    known = replace(player, observer=Observer(rate=np.full(6, 20.0), memory_s=np.full(6, 0.5), past_s=0.5))
    pair = Played(flight, player, player, with_past=known)
    found = replay([pair], 20, 5)
    held = found.along([pair])
    assert tuple(held.models) == (*PREDICTIONS, WITH_PAST)
    runs = free_runs(known, flight, flight.starts(20, 5), 20)
    expected = np.linalg.norm(runs.errors[:, :, 3], axis=2).mean(axis=0)
    np.testing.assert_allclose(held.models[WITH_PAST].body_rate.mae, expected)
    vehicle = vehicle_of(whole(), held_out=held, history=known.observer)
    said = stage.text(vehicle, about=source_of_vehicle(vehicle))
    smaller = 1 - held.models[WITH_PAST].body_rate.sum / held.model.body_rate.sum
    assert f"body rate {100 * smaller:.0f} % smaller" in said
    assert len(re.findall(r"\|\s*with the past\s*\|", said)) == 4
