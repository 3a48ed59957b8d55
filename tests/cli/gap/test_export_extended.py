"""`cpfls export` of a model with effects, and the vehicle that stands in it."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.store import read_record
from tests.builders.artifacts import edited


def test_an_extended_model_holds_the_vehicle_with_its_effects(extended):
    record = read_record(extended, ExtendedRecord)
    vehicle = record.vehicle.vehicle_model()
    effects = {one.name: one.coefficients for one in vehicle.effects}
    assert effects["com_offset"] == pytest.approx([0.008, -0.005], rel=0.05)
    assert record.vehicle.not_held == ()
    np.testing.assert_allclose(record.vehicle.inertia, record.inertia, rtol=1e-12)


def test_it_is_exported(cpfls, extended, tmp_path):
    output = tmp_path / "quad.py"
    result = cpfls("export", extended, "-o", output)
    assert result.exit_code == 0, result.stderr
    assert "Effects: " in result.stdout
    assert "On held-out flights its largest gap is " in result.stdout
    done = subprocess.run([sys.executable, "-I", output], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    names = {"__name__": "quad"}
    exec(output.read_text(), names)
    # Where the centre of mass is off, equal rotors tilt the vehicle.
    torque, force = names["wrench"](np.zeros(3), np.zeros(3), names["steady"](np.full(4, 350.0)))
    offset = read_record(extended, ExtendedRecord).vehicle.effect.linear_of("com_offset")
    thrust = 4 * 121.5e-6 * 350.0**2
    np.testing.assert_allclose(torque[:2], [-offset[1] * thrust, offset[0] * thrust], rtol=1e-9)
    assert force[2] == pytest.approx(thrust, rel=0.02)


def test_one_of_before_is_refused(refuse, extended, tmp_path):
    old = tmp_path / "old.h5"
    shutil.copy(extended, old)
    with edited(old) as file:
        del file["vehicle"]
    (line,) = refuse("export", old, "-o", tmp_path / "m.c")
    assert line.startswith(f"{old}: was made before models with effects could be exported; make it again with ")


def test_an_identified_model_holds_the_stated_vehicle(pipeline):
    record = read_record(pipeline.model, ModelRecord)
    assert record.vehicle.vehicle() == record.study.vehicle
    assert record.vehicle.effect.name == ()


def test_the_json_of_an_extended_model_says_what_it_is_worth(cpfls, extended, tmp_path):
    assert cpfls("export", extended, "-o", tmp_path / "m.json").exit_code == 0
    document = json.loads((tmp_path / "m.json").read_text())
    assert document["worth"][0].startswith("On held-out flights its largest gap is ")
    assert "com_offset" in document["effects"]
