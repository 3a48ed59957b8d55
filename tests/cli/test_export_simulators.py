"""`cpfls export` for simulators and libraries: the files it writes, what it says is missing, and what it refuses."""

import json
import shutil
import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.export.registry import FORMS
from cpfls_cli.playback.model import ModelEffect
from tests.builders.artifacts import edited
from tests.builders.flown_exports import FLYING
from tests.builders.playback_flights import truth
from tests.builders.vehicle_models import HEXA, vehicle_of, whole, write_vehicle

LOAD = ModelEffect("payload", {"length_m": 0.3, "damping_1_s": 0.6, "depth_m": 0.05}, np.array([0.03, 0.0, 0.0, 0.3]))
HOSTILE = '--> </sdf> <x a="\'&]]>--\n"""\nraise SystemExit(7)\n\u202e -'


@pytest.fixture
def vehicle(tmp_path):
    path = tmp_path / "vehicle.h5"
    write_vehicle(path, vehicle_of(truth()))
    return path


def read(form, output):
    """Take a file as its target does."""
    if FORMS[form].ending == ".py":
        compile(output.read_text(), str(output), "exec")
    elif FORMS[form].ending == ".json":
        return json.loads("\n".join(line for line in output.read_text().splitlines() if not line.startswith("#")))
    elif FORMS[form].ending == ".proto":
        # Quotes and braces of the words of others stay behind the signs of comments.
        lines = output.read_text().splitlines()
        assert lines[0] == "#VRML_SIM R2023b utf8"
        plain = "\n".join(line for line in lines if not line.startswith("#"))
        assert all(plain.count(one) == plain.count(other) for one, other in ("{}", "[]"))
    elif FORMS[form].ending == ".toml":
        return tomllib.loads(output.read_text())
    else:
        return ElementTree.fromstring(output.read_text())
    return None


@pytest.mark.parametrize("form", FLYING)
def test_a_vehicle_is_exported_and_hostile_names_stay_text(cpfls, tmp_path, form):
    inputs = {"flight": InputFile("flight.h5", "0" * 64, "cpfls/flight")}
    path = tmp_path / ("x--" + "' \"; raise SystemExit(8)\n#-->.h5")
    write_vehicle(path, vehicle_of(replace(truth(), effects=(*truth().effects, LOAD))), inputs=inputs)
    with edited(path) as file:
        file["inputs/flight"].attrs["name"] = HOSTILE
    output = tmp_path / f"uav{FORMS[form].ending}"
    words = ("export", path, "--format", form, "-o", output)
    result = cpfls(*words, "--json")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    sizes = [Path(written).stat().st_size for written in summary["output"]]
    assert (summary["format"], summary["rotors"], summary["bytes"]) == (form, 4, sum(sizes))
    assert summary["output"][-1] == str(output)
    title = summary["missing"][-1]["title"]
    assert title.startswith("load on a cable (")
    assert summary["missing"][-1] == {
        "title": title, "torque": None, "force": None, "floors": None, "off": None, "where": "about hover"
    }  # fmt: skip
    read(form, output)
    first = output.read_bytes()
    assert "Not held: load on a cable" in output.read_text()
    if form == "casadi":
        assert len(summary["missing"]) == 1
    elif form == "mjcf":
        said = cpfls(*words, "--force").stdout
        assert output.read_bytes() == first
        assert "Not held: load on a cable" in said
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


def test_px4_gets_its_sensors_and_an_airframe(cpfls, vehicle, tmp_path):
    output = tmp_path / "uav.sdf"
    assert cpfls("export", vehicle, "--format", "px4", "-o", output).exit_code == 0
    model = read("px4", output).find("model")
    names = [sensor.get("name") for sensor in model.findall("link[@name='base_link']/sensor")]
    assert names == ["imu_sensor", "air_pressure_sensor", "magnetometer_sensor", "navsat_sensor"]
    # PX4's bridge publishes under the name that the model is spawned by.
    assert not list(model.iter("robotNamespace"))
    airframe = output.with_suffix(".airframe")
    assert subprocess.run(["sh", "-n", airframe], check=False).returncode == 0
    assert "\n# @type Quadrotor x\n" in airframe.read_text()
    lines = [line.split() for line in airframe.read_text().splitlines() if line.startswith("param set-default")]
    parameters = {name: float(value) for _, _, name, value in lines}
    assert parameters["CA_ROTOR_COUNT"] == 4
    for rotor, known in enumerate(truth().vehicle.rotors):
        x, y, _ = known.position_m
        assert parameters[f"CA_ROTOR{rotor}_PX"] == pytest.approx(x)
        assert parameters[f"CA_ROTOR{rotor}_PY"] == pytest.approx(-y)
        lever = known.drag_factor_n_m_s2 / known.thrust_factor_n_s2
        assert parameters[f"CA_ROTOR{rotor}_KM"] == pytest.approx(known.spin * lever)
        assert parameters[f"SIM_GZ_EC_FUNC{rotor + 1}"] == 101 + rotor
    weight = truth().vehicle.mass_kg * truth().vehicle.gravity_m_s2
    assert parameters["MPC_THR_HOVER"] == pytest.approx(weight / (4 * known.thrust_factor_n_s2 * 1500.0**2))


def test_a_section_of_toml_has_what_the_dynamics_take(cpfls, vehicle, tmp_path):
    output = tmp_path / "uav.toml"
    assert cpfls("export", vehicle, "-o", output).exit_code == 0
    (name, section), *_ = read("crazyflow", output).items()
    assert name == "uav"
    assert section["mass"] == 0.8
    most = section["rpm2thrust"][2] * (1500.0 * 30 / np.pi) ** 2
    assert section["thrust_max"] == pytest.approx(most)
    assert section["rotor_dyn_coef"] == [1 / 0.035, 0.0, 1 / 0.035, 0.0]
    rolling = [known.position_m[1] / section["L"] for known in truth().vehicle.rotors]
    assert section["mixing_matrix"][0] == pytest.approx(rolling)
    assert section["mixing_matrix"][2] == [-known.spin for known in truth().vehicle.rotors]


def test_urdf_is_read_by_a_parser_of_others(cpfls, vehicle, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs the package yourdfpy, which reads URDF")
    output = tmp_path / "uav.urdf"
    assert cpfls("export", vehicle, "-o", output).exit_code == 0
    robot = yourdfpy.URDF.load(str(output), load_meshes=False, build_scene_graph=False).robot
    links = {link.name: link.inertial for link in robot.links}
    assert links["base_link"].mass == 0.8
    assert np.allclose(np.diag(links["base_link"].inertia), truth().vehicle.inertia_kg_m2[:3])
    assert [joint.type for joint in robot.joints] == ["fixed"] * 5
    properties = read("urdf", output).find("properties").attrib
    turns = [-truth().vehicle.rotors[int(rotor) - 1].spin for rotor in properties["rotors"].split()]
    assert turns == [-1, 1, -1, 1]


def test_a_frame_of_ardupilot_has_its_keys_in_its_order(cpfls, vehicle, tmp_path):
    output = tmp_path / "uav.json"
    assert cpfls("export", vehicle, "--format", "ardupilot", "-o", output).exit_code == 0
    keys, known = read("ardupilot", output), truth().vehicle
    assert (keys["mass"], keys["num_motors"], keys["propExpo"]) == (0.8, 4, 1.0)
    assert keys["moment_inertia"] == pytest.approx(known.inertia_kg_m2[:3])
    most = 4 * known.rotors[0].thrust_factor_n_s2 * 1500.0**2
    assert keys["hoverThrOut"] == pytest.approx(0.8 * 9.80665 / most)
    rotor, hover = known.rotors[0], np.sqrt(keys["hoverThrOut"]) * 1500.0
    lift = 3 * rotor.thrust_factor_n_s2 * hover**2 / 1500.0
    slope = 0.05 * keys["diagonal_size"] * keys["motor1_yaw"] * lift
    # Yaw torque by its cube grows in hover as the vehicle's by its square.
    assert slope == pytest.approx(2 * rotor.drag_factor_n_m_s2 * hover)
    # Front right and rear left turn counter-clockwise, the axes are forward, right, down.
    for motor, (forward, right, turn) in enumerate(((1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)), 1):
        assert np.sign(keys[f"motor{motor}_position"][:2]).tolist() == [forward, right]
        assert np.sign(keys[f"motor{motor}_yaw"]) == turn
    assert sorted(keys["rotors"]) == [1, 2, 3, 4]
    assert "sim_vehicle.py -v ArduCopter --model x:uav.json" in output.read_text()


def test_an_airframe_says_where_a_range_holds_the_hover_thrust(cpfls, tmp_path):
    light = replace(truth(), vehicle=replace(truth().vehicle, rotor_speed_max_rad_s=6000.0))
    write_vehicle(tmp_path / "light.h5", vehicle_of(light))
    assert cpfls("export", tmp_path / "light.h5", "--format", "px4", "-o", tmp_path / "uav.sdf").exit_code == 0
    text = " ".join((tmp_path / "uav.airframe").read_text().replace("#", " ").split())
    assert "param set-default MPC_THR_HOVER 0.1 " in text + " "
    assert "outside PX4's range of 0.1 to 0.8" in text


def test_an_identified_model_is_exported_as_a_vehicle(cpfls, pipeline, tmp_path):
    result = cpfls("export", pipeline.model, "--format", "casadi", "-o", tmp_path / "quad.py", "--force")
    assert result.exit_code == 0, result.stderr
    assert "CasADi holds all of it." in result.stdout
    assert "inertia over attitude" not in result.stdout


def test_what_a_target_cannot_hold_at_all(refuse, tmp_path):
    path = tmp_path / "hexa.h5"
    write_vehicle(path, vehicle_of(replace(whole(HEXA), effects=(), remainder=None)))
    (line,) = refuse("export", path, "--format", "rotorpy", "-o", tmp_path / "uav.py")
    assert line == (
        f"{path.name}: RotorPy allocates thrust and torque to four rotors, but this vehicle has 6; --format mjcf, sdf, "
        "jax and casadi take any number"
    )
    assert not (tmp_path / "uav.py").exists()
    for form, words in (
        ("crazyflow", "crazyflow and drone-models mix four"),
        ("urdf", "turns four rotors, two each way"),
    ):
        (line,) = refuse("export", path, "--format", form, "-o", tmp_path / f"uav{FORMS[form].ending}")
        assert words in line


@pytest.mark.parametrize("ending", ["xml", "c"])
def test_a_vehicle_that_should_not_be_used(cpfls, refuse, vehicle, tmp_path, monkeypatch, ending):
    monkeypatch.setattr(Vehicle, "verdict", "do-not-use")
    output = tmp_path / f"uav.{ending}"
    (line,) = refuse("export", vehicle, "-o", output)
    assert line == f"{vehicle}: its verdict is do-not-use; --anyway exports it, marked as such"
    result = cpfls("export", vehicle, "-o", output, "--force")
    assert result.exit_code == 0
    mark = "DO NOT USE: this is the verdict on the model"
    assert mark in result.stdout
    assert mark in output.read_text()[:600]
