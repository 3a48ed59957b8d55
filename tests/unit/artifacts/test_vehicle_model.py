"""A whole vehicle comes back from its file as it was."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.flights.models import any_model, found_vehicle, holds_forecast, is_found, is_model, modelled, read_model
from cpfls_cli.playback.constants import ExplainedBand, UsedInstruments
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.result import plain
from tests.builders.vehicle_models import HEXA, QUAD, remainder, vehicle_of, whole, wrench_somewhere, write_vehicle

MODELS = {
    "quad": whole(),
    "hexa, seesaw": whole(HEXA, order=0),
    "one rule": whole(remainder=remainder(1, breakpoints=(0.0,))),
    "plain": VehicleModel(vehicle=QUAD),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
def test_the_round_trip_is_exact(model, tmp_path):
    path = tmp_path / "vehicle.h5"
    write_vehicle(path, vehicle_of(model))
    assert store.examine(path, Vehicle)[2] == []
    assert is_model(path)
    assert is_found(path)
    again = any_model(path).model
    assert again.vehicle == model.vehicle
    assert (again.response, again.thrust_linear) == (model.response, model.thrust_linear)
    assert [(one.name, one.shape) for one in again.effects] == [(one.name, one.shape) for one in model.effects]
    assert np.array_equal(wrench_somewhere(again), wrench_somewhere(model))


def test_instruments_have_bands_of_their_own(tmp_path):
    vehicle, path = vehicle_of(MODELS["plain"]), tmp_path / "vehicle.h5"
    loop = vehicle.loop._replace(band_hz=np.ones((4, 2)), by_band=np.ones((4, 3)), missed=np.full(3, 0.1))
    three = np.full(3, 0.9)
    bands = (ExplainedBand(1.0, 2.0, np.ones(3), True),) * 5
    used = UsedInstruments(kind="past", bands=bands, explained=three, explained_error=three)
    write_vehicle(path, replace(vehicle, loop=loop, instruments=used))
    again = found_vehicle(path)
    assert (len(again.loop.by_band), len(again.instruments.bands), again.loop.misses) == (4, 5, True)


def test_an_effect_that_nobody_knows_is_refused(tmp_path):
    unknown = replace(MODELS["plain"], effects=(ModelEffect("rotor_dragg", {}, np.ones(1)),))
    with pytest.raises(InputError, match=r"rotor_dragg: no such effect \(did you mean rotor_drag"):
        modelled(tmp_path / "v.h5", vehicle_of(unknown))


@pytest.mark.parametrize("kind", [IdentifiedModel, Vehicle])
def test_every_model_answers_the_same_questions(kind):
    assert issubclass(kind, AnyModel)


def test_machines_read_what_the_model_has():
    told = plain(vehicle_of(MODELS["quad"]))["model"]
    assert told["vehicle"]["mass_kg"] == 0.9
    assert told["vehicle"]["inertia_kg_m2"][4] == -2e-4
    assert told["response"]["lag_s"] == 0.035
    assert [each["name"] for each in told["effects"]] == [one.name for one in MODELS["quad"].effects]
    assert told["remainder"]["rows"] == [0, 2, 5]


def test_a_forecast_has_parts_of_its_own(tmp_path):
    """Its axes are as long as they like, and replays take it where others take the vehicle."""
    path, study = tmp_path / "vehicle.h5", Study()
    write_vehicle(path, vehicle_of(MODELS["plain"], forecast=MODELS["quad"]))
    again = found_vehicle(path)
    assert holds_forecast(path)
    assert not read_model(path, study).effects
    assert read_model(path, study, forecast=True).effects
    assert not again.model.effects
    assert [one.name for one in again.forecast.effects] == [one.name for one in MODELS["quad"].effects]
    assert again.forecast.remainder.rows.tolist() == MODELS["quad"].remainder.rows.tolist()
