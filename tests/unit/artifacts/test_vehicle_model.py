"""A whole vehicle comes back from its artifact as it was."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.store import read_artifact, read_record, write_record
from cpfls_cli.artifacts.vehicle_model import VehicleGroup, VehicleRecord
from cpfls_cli.errors import InputError
from cpfls_cli.playback.model import VehicleModel
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
    write_record(path, record_of(model, ("wind",)))
    assert check_artifact(read_artifact(path)) == []
    record = read_record(path, VehicleRecord)
    again = record.vehicle.vehicle_model()
    assert again.vehicle == model.vehicle
    assert (again.response, again.thrust_linear) == (model.response, model.thrust_linear)
    assert [(one.name, one.shape) for one in again.effects] == [(one.name, one.shape) for one in model.effects]
    assert np.array_equal(again.weights, model.weights)
    assert all(np.array_equal(new, old) for new, old in zip(again.airflow, model.airflow, strict=True))
    assert record.vehicle.not_held == ("wind",)


def test_an_effect_that_nobody_knows_is_refused():
    group = VehicleGroup.of(MODELS["quad"])
    unknown = replace(group, effect=replace(group.effect, name=("rotor_dragg",)))
    with pytest.raises(InputError, match=r"rotor_dragg: no such effect \(did you mean rotor_drag"):
        unknown.vehicle_model()


@pytest.mark.parametrize("kind", [ModelRecord, ExtendedRecord])
def test_other_models_may_lack_the_vehicle(kind):
    paths = [spec for spec in kind.spec().datasets if spec.path.startswith("vehicle/")]
    assert paths
    assert not any(spec.required for spec in paths)


def test_the_summary_names_what_the_model_has():
    summary = record_of(MODELS["quad"], ("wind",)).summary
    assert summary["mass_kg"] == 0.9
    assert summary["inertia_kg_m2"]["Ixz"] == -2e-4
    assert summary["response"]["lag_s"] == 0.035
    assert list(summary["effects"]) == [one.name for one in MODELS["quad"].effects]
    assert summary["remainder"] == [0, 2, 5]
    assert summary["not_held"] == ["wind"]
