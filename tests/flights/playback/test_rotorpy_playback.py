"""Another team's simulator, played back: with what its origin states as hidden nothing is left, without it much is."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.shared.playback_scores import free_runs, rate_stays, score
from cpfls_cli import load_model
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from tests.builders.command_line import run
from tests.builders.playback_flights import ROTORPY_HIDDEN, rotorpy_flight, rotorpy_truth
from tests.builders.recorded_flights import path_of_log
from tests.builders.vehicle_models import vehicle_of, write_vehicle

CONFIG = Path(__file__).parents[3] / "configs" / "gap" / "rotorpy.yaml"


@pytest.mark.parametrize("name", ROTORPY_HIDDEN)
def test_the_model_that_flew_plays_the_flight_back(name):
    flight = rotorpy_flight(name)
    truth = score([free_runs(rotorpy_truth(name), flight, every=5)])
    stays = score([rate_stays(flight, every=5)])
    # Measured speeds are joined by straight lines; the rotors follow with a lag of 5 ms.
    assert (truth.sums < 4e-4 * stays.sums).all()


@pytest.mark.parametrize("name", [name for name, hidden in ROTORPY_HIDDEN.items() if hidden])
def test_what_is_hidden_is_seen(name):
    flight = rotorpy_flight(name)
    without, truth = (score([free_runs(rotorpy_truth(model), flight, every=5)]) for model in ("none", name))
    assert (without.sums > 1000 * truth.sums).all()


def answered(*words):
    result = run(*words, "--json", "--force")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


@pytest.mark.parametrize("name", [name for name, hidden in ROTORPY_HIDDEN.items() if hidden])
def test_torque_and_force_of_the_model_that_flew_are_what_the_motion_takes(name, tmp_path):
    """About 1e-6 N m and N; at its first samples one flight falls into its path."""
    log, flight, study = path_of_log("rotorpy", name), tmp_path / "flight.h5", load_study(CONFIG)
    answered("import", CONFIG, log, "-o", flight)
    found, gaps = {}, {}
    for model in ("none", name):
        vehicle = replace(rotorpy_truth(model), vehicle=study.vehicle)
        write_vehicle(tmp_path / "vehicle.h5", vehicle_of(vehicle), resolved_yaml(study))
        found[model] = load_model(tmp_path / "vehicle.h5", CONFIG).predict(flight)
        words = ("compare", CONFIG, flight, "--model", tmp_path / "vehicle.h5", "-o", tmp_path / "gap.h5")
        gaps[model] = answered(*words)["gap"]
    assert found[name].score.r2_body.min() > 0.999 > found["none"].score.r2_body.min()
    assert found[name].force_rms.max() < 1e-6
    assert max(gaps[name]["floors"]) < 0.1
    assert max(gaps["none"]["floors"]) > 200
