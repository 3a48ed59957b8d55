"""`cpfls export` of a model with effects, and the vehicle that stands in it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.config.load import stored_study
from cpfls_cli.gap.before_after import LeftOut
from cpfls_cli.inertia import six_parameters
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.store import read
from tests.builders.artifacts import with_fields
from tests.builders.exported_vehicles import on_numpy


def test_an_extended_model_holds_the_vehicle_with_its_effects(extended):
    record = read(extended, Extended)[0]
    vehicle = record.model
    effects = {one.name: one.coefficients for one in vehicle.effects}
    # The height, which the thrust alone does not show, is left open.
    assert effects["com_offset"] == pytest.approx([0.008, -0.005, 0.0], rel=0.05)
    assert vehicle.unsimulated == ()
    np.testing.assert_allclose(six_parameters(vehicle.vehicle.inertia_kg_m2), record.inertia, rtol=1e-12)


def test_it_is_exported(cpfls, extended, tmp_path):
    output = tmp_path / "quad.py"
    result = cpfls.done("export", extended, "--format", "jax", "-o", output)
    assert "Effects: " in result.stdout
    assert "On held-out flights its largest gap is " in result.stdout
    names = on_numpy(output.read_text())
    # Where the centre of mass is off, equal rotors tilt the vehicle.
    wrench = names["wrench"](np.zeros(3), np.zeros(3), names["steady"](np.full(4, 350.0)))
    torque, force = wrench[:3], wrench[3:]
    effects = {one.name: one.coefficients for one in read(extended, Extended)[0].model.effects}
    offset = effects["com_offset"]
    thrust = 4 * 121.5e-6 * 350.0**2
    np.testing.assert_allclose(torque[:2], [-offset[1] * thrust, offset[0] * thrust], rtol=1e-9)
    assert force[2] == pytest.approx(thrust, rel=0.02)


def test_what_a_table_does_not_hold_is_said_with_numbers_and_size(cpfls, extended, tmp_path):
    record = read(extended, Extended)[0]
    size, ends = np.array([0.0, 0.4, 0.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.2, 0.3, 0.4])
    sag = ModelEffect("battery_sag", {"exponent": 1.5}, np.zeros(0))
    outside = replace(record.model, effects=(*record.model.effects, sag))
    path, output = tmp_path / "outside.h5", tmp_path / "m.c"
    with_fields(extended, path, model=outside, left_out=(LeftOut("battery_sag", size, ends),))
    said = cpfls("export", path, "-o", output).stdout.splitlines()[-1]
    assert said.startswith("Not held, or only in part: battery sag (")
    floors = 0.4 / record.gap.floor[1]
    assert said.endswith(
        f"; exponent = 1.5): 0.4 N m and 0 N along its held-out flights, {floors:.3g} noise floors; half a second "
        "without it ends 0.4 rad/s, 17.2 degrees, 0.2 m/s and 0.1 m off."
    )
    assert "along its held-out flights" in " ".join(output.read_text().split())


def test_an_identified_inertia_under_effects(cpfls, extended, pipeline, tmp_path):
    record, identified = read(extended, Extended)[0], read(pipeline.model, IdentifiedModel)[0]
    path = tmp_path / "over.h5"
    with_fields(extended, path, model=replace(record.model, fuzzy=identified.functions))
    said = cpfls("export", path, "--format", "casadi", "-o", tmp_path / "over_casadi.py").stdout
    assert said.splitlines()[-1] == "CasADi holds all of it."
    cpfls.done("export", path, "-o", tmp_path / "over.json")
    document = json.loads((tmp_path / "over.json").read_text())
    assert document["inertia_kg_m2"] is None
    assert document["structure"] is not None


def test_an_identified_model_holds_the_stated_vehicle(pipeline):
    made, origin = read(pipeline.model, IdentifiedModel)
    assert made.model.vehicle == stored_study(origin.config, pipeline.model).vehicle
    assert made.model.effects == ()


def test_the_json_of_an_extended_model_says_what_it_is_worth(cpfls, extended, tmp_path):
    cpfls.done("export", extended, "-o", tmp_path / "m.json")
    document = json.loads((tmp_path / "m.json").read_text())
    assert any(line.startswith("On held-out flights its largest gap is ") for line in document["worth"])
    assert "com_offset" in document["effects"]
