"""`cpfls export` for simulators and libraries: the files it writes, what it says is missing, and what it refuses."""

import json
import shutil
import subprocess
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from cpfls_cli.artifacts.spec import Header, InputFile
from cpfls_cli.artifacts.store import write_record
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.export.registry import TARGETS
from cpfls_cli.playback.model import ModelEffect
from tests.builders.artifacts import edited
from tests.builders.playback_flights import truth
from tests.builders.vehicle_models import HEXA, record_of, whole

LOAD = ModelEffect("payload", {"length_m": 0.3, "damping_1_s": 0.6, "depth_m": 0.05}, np.array([0.03, 0.0, 0.0, 0.3]))
HOSTILE = '--> </sdf> <x a="\'&]]>--\n"""\nraise SystemExit(7)\n\u202e -'


@pytest.fixture
def vehicle(tmp_path):
    path = tmp_path / "vehicle.h5"
    write_record(path, record_of(truth()))
    return path


def read(form, output):
    """Take a file as its target does."""
    if TARGETS[form].ending == ".py":
        compile(output.read_text(), str(output), "exec")
    else:
        return ElementTree.fromstring(output.read_text())
    return None


@pytest.mark.parametrize("form", TARGETS)
def test_a_vehicle_is_exported_and_hostile_names_stay_text(cpfls, tmp_path, form):
    header = Header("0", 1, "seed: 1\n", {"flight": InputFile("flight.h5", "0" * 64, "cpfls/flight")})
    path = tmp_path / ("x--" + "' \"; raise SystemExit(8)\n#-->.h5")
    write_record(path, record_of(replace(truth(), effects=(*truth().effects, LOAD))).with_header(header))
    with edited(path) as file:
        file["inputs/flight"].attrs["name"] = HOSTILE
    output = tmp_path / f"uav{TARGETS[form].ending}"
    words = ("export", path, "--format", form, "-o", output)
    result = cpfls(*words, "--json")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert (summary["format"], summary["rotors"], summary["bytes"]) == (form, 4, output.stat().st_size)
    title = summary["missing"][-1]["title"]
    assert title.startswith("load on a cable (")
    assert summary["missing"][-1] == {
        "title": title, "torque": None, "force": None, "floors": None, "off": None, "where": "about hover"
    }  # fmt: skip
    read(form, output)
    first = output.read_bytes()
    said = cpfls(*words, "--force").stdout
    assert output.read_bytes() == first
    assert "Not held: load on a cable" in said
    assert "Not held: load on a cable" in output.read_text()
    if form in ("casadi", "jax"):
        assert len(summary["missing"]) == 1
    else:
        assert "half a second without it ends" in said


def test_links_of_gazebo_are_bodies_and_weigh_what_the_vehicle_does(cpfls, vehicle, tmp_path):
    output = tmp_path / "uav.sdf"
    assert cpfls("export", vehicle, "-o", output, "--name", "my_quad").exit_code == 0
    model = read("sdf", output).find("model")
    assert model.get("name") == "my_quad"
    links = model.findall("link")
    assert sum(float(link.findtext("inertial/mass")) for link in links) == pytest.approx(0.8)
    for link in links:
        found = {entry.tag: float(entry.text) for entry in link.find("inertial/inertia")}
        moments = np.sort([found["ixx"], found["iyy"], found["izz"]])
        assert moments[0] > 0
        assert moments[2] <= moments[0] + moments[1]
    assert [plugin.findtext("turningDirection") for plugin in model.findall("plugin")] == ["ccw", "cw", "ccw", "cw"]


@pytest.mark.skipif(shutil.which("gz") is None, reason="no gz, which checks SDF, on this machine")
def test_gazebo_takes_the_file(cpfls, vehicle, tmp_path):
    output = tmp_path / "uav.sdf"
    assert cpfls("export", vehicle, "-o", output).exit_code == 0
    done = subprocess.run(["gz", "sdf", "-k", output], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_an_identified_model_is_exported_as_a_vehicle(cpfls, pipeline, tmp_path):
    result = cpfls("export", pipeline.model, "--format", "casadi", "-o", tmp_path / "quad.py", "--force")
    assert result.exit_code == 0, result.stderr
    assert "CasADi holds all of it." in result.stdout
    assert "inertia over attitude" not in result.stdout


def test_what_a_target_cannot_hold_at_all(refuse, tmp_path):
    path = tmp_path / "hexa.h5"
    write_record(path, record_of(replace(whole(HEXA), effects=(), remainder=None)))
    (line,) = refuse("export", path, "--format", "rotorpy", "-o", tmp_path / "uav.py")
    assert line == (
        f"{path.name}: RotorPy allocates thrust and torque to four rotors, but this vehicle has 6; --format mjcf, sdf, "
        "jax and casadi take any number"
    )
    assert not (tmp_path / "uav.py").exists()


@pytest.mark.parametrize("ending", ["xml", "c"])
def test_a_vehicle_that_should_not_be_used(cpfls, refuse, vehicle, tmp_path, monkeypatch, ending):
    monkeypatch.setattr(VehicleRecord, "verdict", "do-not-use")
    output = tmp_path / f"uav.{ending}"
    (line,) = refuse("export", vehicle, "-o", output)
    assert line == f"{vehicle}: its verdict is do-not-use; --force exports it anyway, marked as such"
    result = cpfls("export", vehicle, "-o", output, "--force")
    assert result.exit_code == 0
    mark = "DO NOT USE: this is the verdict on the model"
    assert mark in result.stdout
    assert mark in output.read_text()[:600]


def test_output_rules(cpfls, refuse, vehicle, tmp_path):
    (line,) = refuse("export", vehicle, "--format", "mjcf", "-o", tmp_path / "uav.sdf")
    assert line == f"{tmp_path / 'uav.sdf'}: --format mjcf writes a file that ends in .xml; name it so"
    (line,) = refuse("export", vehicle, "--format", "jax", "-o", tmp_path / "jax.py")
    assert "Python cannot import a module of this name" in line
    words = ("export", vehicle, "-o", tmp_path / "uav.xml")
    assert cpfls(*words, "--dry-run").stdout.startswith(f"{tmp_path / 'uav.xml'}: would be written")
    assert not (tmp_path / "uav.xml").exists()
    assert cpfls(*words, "-q").stdout == ""
    assert refuse(*words) == [f"{tmp_path / 'uav.xml'}: exists already; --force replaces it"]
