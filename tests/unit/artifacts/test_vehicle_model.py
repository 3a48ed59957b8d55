"""A whole vehicle comes back from its artifact as it was."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.model import ModelRecord, VehicleGroup
from cpfls_cli.artifacts.rebuilt import vehicle_model
from cpfls_cli.artifacts.store import read_artifact, read_record, write_record
from cpfls_cli.artifacts.vehicle_model import InstrumentsGroup, VehicleRecord
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.audit import Audit
from cpfls_cli.errors import InputError
from cpfls_cli.flights.models import holds_forecast, read_model, rebuilt
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from tests.builders import exported_models
from tests.builders.vehicle_models import HEXA, QUAD, record_of, remainder, whole

MODELS = {
    "quad": whole(),
    "hexa, seesaw": whole(HEXA, order=0),
    "one rule": whole(remainder=remainder(1, breakpoints=(0.0,))),
    "plain": VehicleModel(vehicle=QUAD),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
def test_the_round_trip_is_exact(model, tmp_path):
    path = tmp_path / "vehicle.h5"
    write_record(path, record_of(model))
    assert check_artifact(read_artifact(path)) == []
    record = read_record(path, VehicleRecord)
    again = vehicle_model(record.vehicle)
    assert again.vehicle == model.vehicle
    assert (again.response, again.thrust_linear) == (model.response, model.thrust_linear)
    assert [(one.name, one.shape) for one in again.effects] == [(one.name, one.shape) for one in model.effects]
    assert np.array_equal(again.table.weights, model.table.weights)
    assert all(np.array_equal(new, old) for new, old in zip(again.table.airflow, model.table.airflow, strict=True))


def test_instruments_have_bands_of_their_own(tmp_path):
    record, path = record_of(MODELS["plain"]), tmp_path / "vehicle.h5"
    loop = replace(record.loop, band_hz=np.ones((4, 2)), by_band=np.ones((4, 3)), missed=np.full(3, 0.1))
    three, five = np.full(3, 0.9), np.ones(5)
    told = InstrumentsGroup(
        kind="past",
        setpoint=(),
        first=np.zeros(0, dtype=np.int64),
        second=np.zeros(0, dtype=np.int64),
        likeness=np.zeros(0),
        low=five,
        high=2 * five,
        explained=np.ones((5, 3)),
        total=three,
        error=three,
        used=five > 0,
    )
    write_record(path, replace(record, loop=loop, instruments=told))
    again = read_record(path, VehicleRecord)
    assert (len(again.loop.by_band), len(again.instruments.low), again.loop.misses) == (4, 5, True)


def test_an_effect_that_nobody_knows_is_refused():
    group = VehicleGroup.of(MODELS["quad"])
    unknown = replace(group, effect=replace(group.effect, name=("rotor_dragg",)))
    with pytest.raises(InputError, match=r"rotor_dragg: no such effect \(did you mean rotor_drag"):
        vehicle_model(unknown)


@pytest.mark.parametrize("kind", [IdentifiedRecord, ExtendedRecord, VehicleRecord])
def test_every_model_holds_the_vehicle(kind):
    assert kind.FORMAT.name == ModelRecord.FORMAT.name
    needed = {spec.path for spec in ModelRecord.spec().datasets if spec.required}
    assert "vehicle/mass" in needed
    assert needed <= {spec.path for spec in kind.spec().datasets if spec.required}


def test_inertia_functions_filters_and_repairs_come_back(tmp_path):
    functions = exported_models.model_of(exported_models.CASES["paper"])
    audit = Audit((), {"gyro_bias": "no attitude"}, (), ("late",), None, (), None)
    sag = ModelEffect("battery_sag", {"exponent": 1.5}, np.zeros(0))
    model = VehicleModel(vehicle=QUAD, effects=(sag,), fuzzy=functions, commanded=True, hold="linear", repairs=audit)
    write_record(tmp_path / "m.h5", record_of(model))
    again = rebuilt(tmp_path / "m.h5", read_record(tmp_path / "m.h5", ModelRecord))
    assert (again.commanded, again.hold, again.beside_table) == (True, "linear", ("battery_sag",))
    assert (again.repairs.untested, again.repairs.notes) == (audit.untested, audit.notes)
    attitude = np.random.default_rng(1).uniform(-1, 1, (5, 3))
    np.testing.assert_array_equal(again.fuzzy.inertia(attitude).value, functions.inertia(attitude).value)
    np.testing.assert_array_equal(again.fuzzy.outside(attitude), functions.outside(attitude))


def test_the_summary_names_what_the_model_has():
    summary = record_of(MODELS["quad"]).summary
    assert summary["mass_kg"] == 0.9
    assert summary["inertia_kg_m2"]["Ixz"] == -2e-4
    assert summary["response"]["lag_s"] == 0.035
    assert list(summary["effects"]) == [one.name for one in MODELS["quad"].effects]
    assert summary["remainder"] == [0, 2, 5]
    assert summary["not_held"] == []


def test_a_forecast_stands_beside_the_vehicle_with_parts_of_its_own(tmp_path):
    """Its axes are as long as they like, and replays take it where others take the vehicle."""
    record = replace(record_of(MODELS["plain"]), forecast=VehicleGroup.of(MODELS["quad"]))
    write_record(tmp_path / "vehicle.h5", record)
    assert check_artifact(read_artifact(tmp_path / "vehicle.h5")) == []
    again = read_record(tmp_path / "vehicle.h5", VehicleRecord)
    study = Study()
    assert holds_forecast(tmp_path / "vehicle.h5")
    assert not read_model(tmp_path / "vehicle.h5", study).effects
    assert read_model(tmp_path / "vehicle.h5", study, forecast=True).effects
    assert not vehicle_model(again.vehicle).effects
    assert [one.name for one in vehicle_model(again.forecast).effects] == [one.name for one in MODELS["quad"].effects]
    assert again.forecast.remainder.rows.tolist() == MODELS["quad"].remainder.rows.tolist()
