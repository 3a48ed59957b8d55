"""`cpfls export` of a whole vehicle and for simulators: the files it writes, and what it refuses."""

import json
import re
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
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.export.registry import FORMS
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.playback.player import one_step
from tests.builders.artifacts import edited
from tests.builders.autopilots import STUDY, crossed, found_vehicle
from tests.builders.compiled_c import build, require_gcc
from tests.builders.flown_exports import FLYING
from tests.builders.playback_flights import truth
from tests.builders.vehicle_models import HEXA, QUAD, is_held, polynomial_effects, vehicle_of, whole, write_vehicle

pytestmark = pytest.mark.usefixtures("brief")
ENDINGS = {"json": "json", "c": "c"}
LOAD = ModelEffect("payload", {"length_m": 0.3, "damping_1_s": 0.6, "depth_m": 0.05}, np.array([0.03, 0.0, 0.0, 0.3]))
HOSTILE = '--> </sdf> <x a="\'&]]>--\n"""\nraise SystemExit(7)\n\u202e -'
HEAVY = "Ixx 1.28 kg m^2"


@pytest.fixture
def vehicle(tmp_path):
    return write_vehicle(tmp_path / "vehicle.h5", vehicle_of(whole(effects=polynomial_effects(QUAD)[:2])))


def self_test(output):
    """Run the self-test of exported source."""
    require_gcc()
    command = [build(output.parent, [output.name], "-DCPFLS_SELF_TEST", output="self-test")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("form", ENDINGS)
def test_a_vehicle_is_exported(cpfls, vehicle, tmp_path, form):
    output = tmp_path / "out" / f"quad.{ENDINGS[form]}"
    output.parent.mkdir()
    result = cpfls.done("export", vehicle, "-o", output, "--json")
    assert result.stderr == ""
    summary = json.loads(result.stdout)
    assert sorted(summary["output"]) == sorted(str(path) for path in output.parent.iterdir())
    assert (summary["format"], summary["name"], summary["rotors"], summary["learned"]) == (form, "quad", 4, True)
    assert summary["effects"] == ["linear_damping", "quadratic_damping"]
    if form == "json":
        document = json.loads(output.read_text())
        assert document["format"] == "cpfls/model-json"
        assert len(document["numbers"]) + len(document["learned"]["coefficients"]) == summary["weights"]
    else:
        done = self_test(output)
        assert done.returncode == 0, done.stdout + done.stderr


def test_what_is_said_of_it(cpfls, vehicle, tmp_path):
    result = cpfls("export", vehicle, "--format", "jax", "-o", tmp_path / "quad.py")
    written, caution, about, effects, learned, judged, whole_of_it = result.stdout.splitlines()
    assert caution.startswith("linear damping d_x: at the limit of the search")
    assert written.startswith(f"{tmp_path / 'quad.py'}: written (")
    assert about.startswith("Vehicle: 0.9 kg, 4 rotors; delay 0.013 s, lag 0.035 s, slow actuation -0.4 (roll, pitch)")
    assert effects == "Effects: linear rotational damping, quadratic rotational damping."
    assert learned == "Learned, without a name: torque x, torque z, force z over the direction of the airflow."
    assert judged == (
        "NOT JUDGED: no flight was held out to judge its forecast; its constants are identified; 1 of 2 numbers is "
        "not determined."
    )
    assert whole_of_it == "JAX holds all of it."
    assert effects in (tmp_path / "quad.py").read_text()


@pytest.mark.parametrize("form", ENDINGS)
def test_what_an_export_cannot_hold_is_named_on_the_screen_and_in_the_file(cpfls, tmp_path, form):
    path, output = tmp_path / "vehicle.h5", tmp_path / f"m.{ENDINGS[form]}"
    none = np.zeros(0)
    beside = ModelEffect("ground_effect", {"G": 1.2}, none), ModelEffect("battery_sag", {"exponent": 1.5}, none)
    write_vehicle(
        path, vehicle_of(replace(whole(effects=beside, remainder=None), wind=(3.0, 0.5, 0.0), full_voltage=16.8))
    )
    titles = [each["title"] for each in cpfls.summary("export", path, "-o", output)["missing"]]
    # Nothing of this vehicle meets the air, so that the wind does nothing.
    assert [title.partition(" (")[0] for title in titles] == ["battery sag", "ground effect"]
    assert titles[0].endswith("; exponent = 1.5, V_0 = 16.8 V)")
    said = cpfls("export", path, "-o", output, "--force").stdout.splitlines()
    instead = (
        "multiply commands by (V/V_0)^(n/2) before they are passed, by 0.924 where V is 90 % of V_0",
        "its size depends on the flight and was not measured along one",
    )
    whats = zip(titles, instead, strict=True)
    assert said[-2:] == [f"Not held: {' '.join(title.split())}; {what}." for title, what in whats]
    written = " ".join(output.read_text().replace("\n *", " ").replace("\n#", " ").split())
    assert all(" ".join(sentence.split()) in written for sentence in said[-2:])
    if form != "json":
        assert self_test(output).returncode == 0


def test_a_vehicle_of_wrong_content_is_refused(refuse, vehicle, tmp_path):
    with edited(vehicle) as file:
        del file["model/effects/name"]
        file["model/effects/name"] = np.char.encode(np.array(["linear_damping", "quadratic_dampin"]), "utf-8")
    (line,) = refuse("export", vehicle, "-o", tmp_path / "m.c")
    assert line.startswith(f"{vehicle}: quadratic_dampin: no such effect (did you mean quadratic_damping")
    with edited(vehicle) as file:
        file["model/vehicle/mass_kg"][()] = np.nan
    (line,) = refuse("export", vehicle, "-o", tmp_path / "m.c")
    assert line == f"{vehicle}: model/vehicle/mass_kg: 1 of 1 values are not finite"


PAGE = (Path(__file__).parents[2] / "docs" / "export.md").read_text(encoding="utf-8")
FLIGHT = """
#include <stdio.h>
#include "uav.h"
unsigned predict(uav_state *s, double speed[][UAV_ROTORS], int n, double period);
int main(void)
{
    double speed[20][UAV_ROTORS];
    uav_state s = {{0, 0, 0}, {1, 0, 0}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};
    unsigned status;
    int k;
    for (k = 0; k < 20 * UAV_ROTORS; ++k)
        speed[k / UAV_ROTORS][k % UAV_ROTORS] = 1000 + 7 * (k % 13);
    status = predict(&s, speed, 20, 0.01);
    printf("%u %.17g %.17g %.17g\\n", status, s.position[0], s.velocity[2], s.rate[1]);
    return 0;
}
"""


def blocks(language):
    """Code of the page in a language, that of the section on whole vehicles."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE[PAGE.index("## A whole vehicle") :], re.DOTALL)


def test_the_page_predicts_what_the_library_does(cpfls, tmp_path, monkeypatch):
    require_gcc()
    monkeypatch.chdir(tmp_path)
    model = whole(effects=polynomial_effects(QUAD)[:2])
    write_vehicle(tmp_path / "extended.h5", vehicle_of(model))
    (commands,), (code,) = blocks("sh"), blocks("c")
    for line in commands.splitlines():
        cpfls.done(*line.split("#")[0].split()[1:])
    (tmp_path / "main.c").write_text(FLIGHT)
    (tmp_path / "predict.c").write_text(code)
    program = build(tmp_path, ["main.c", "predict.c", "uav.c"])
    said = [float(word) for word in subprocess.run([program], capture_output=True, check=True).stdout.split()]
    speed = (1000.0 + 7 * (np.arange(80) % 13)).reshape(20, 4)
    state = State(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), np.eye(3)[None], np.zeros((1, 3)))
    for row in model.response.terms_by_step(speed, 0.01, "previous"):
        state = one_step(model, state, row[None], 0.01)
    np.testing.assert_allclose(said, [0, state.position[0, 0], state.velocity[0, 2], state.rate[0, 1]], rtol=1e-9)


def test_the_page_lists_what_an_export_cannot_hold():
    refused = []
    for known in CATALOGUE.values():
        hooks = known.actuation
        held = known.in_vehicle is not None or (hooks is not None and (hooks.lag or hooks.delay))
        if known.kind in ("wrench", "actuator") and not held and not is_held(known, QUAD):
            refused.append(known.name)
        if known.exact is not None and known.exact.in_vehicle:
            refused.remove(known.name)
    (said,) = re.findall(r"Not every effect is held: (.*?) are not", PAGE, re.DOTALL)
    assert sorted(re.findall(r"`(\w+)`", said)) == sorted(refused)


@pytest.fixture
def vehicle_file(tmp_path):
    return write_vehicle(tmp_path / "vehicle.h5", vehicle_of(truth()))


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
    summary = cpfls.summary(*words)
    sizes = [Path(written).stat().st_size for written in summary["output"]]
    assert (summary["format"], summary["rotors"], summary["bytes"]) == (form, 4, sum(sizes))
    assert summary["output"][-1] == str(output)
    title = summary["missing"][-1]["title"]
    assert title.startswith("load on a cable (")
    assert summary["missing"][-1] == {
        "title": title, "torque": None, "force": None, "floors": None, "off": None, "where": "about hover",
        "instead": None,
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


def test_links_of_gazebo_are_bodies_and_weigh_what_the_vehicle_does(cpfls, vehicle_file, tmp_path):
    output = cpfls.made("export", vehicle_file, "--name", "my_quad", at=tmp_path / "uav.sdf")
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
def test_gazebo_takes_the_file(cpfls, vehicle_file, tmp_path):
    output = cpfls.made("export", vehicle_file, at=tmp_path / "uav.sdf")
    done = subprocess.run(["gz", "sdf", "-k", output], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_px4_gets_its_sensors_and_an_airframe(cpfls, vehicle_file, tmp_path):
    output = cpfls.made("export", vehicle_file, "--format", "px4", at=tmp_path / "uav.sdf")
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


def test_a_section_of_toml_has_what_the_dynamics_take(cpfls, vehicle_file, tmp_path):
    (name, section), *_ = read("crazyflow", cpfls.made("export", vehicle_file, at=tmp_path / "uav.toml")).items()
    assert name == "uav"
    assert section["mass"] == 0.8
    most = section["rpm2thrust"][2] * (1500.0 * 30 / np.pi) ** 2
    assert section["thrust_max"] == pytest.approx(most)
    assert section["rotor_dyn_coef"] == [1 / 0.035, 0.0, 1 / 0.035, 0.0]
    rolling = [known.position_m[1] / section["L"] for known in truth().vehicle.rotors]
    assert section["mixing_matrix"][0] == pytest.approx(rolling)
    assert section["mixing_matrix"][2] == [-known.spin for known in truth().vehicle.rotors]


def test_urdf_is_read_by_a_parser_of_others(cpfls, vehicle_file, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason="needs the package yourdfpy, which reads URDF")
    output = cpfls.made("export", vehicle_file, at=tmp_path / "uav.urdf")
    robot = yourdfpy.URDF.load(str(output), load_meshes=False, build_scene_graph=False).robot
    links = {link.name: link.inertial for link in robot.links}
    assert links["base_link"].mass == 0.8
    assert np.allclose(np.diag(links["base_link"].inertia), truth().vehicle.inertia_kg_m2[:3])
    assert [joint.type for joint in robot.joints] == ["fixed"] * 5
    properties = read("urdf", output).find("properties").attrib
    turns = [-truth().vehicle.rotors[int(rotor) - 1].spin for rotor in properties["rotors"].split()]
    assert turns == [-1, 1, -1, 1]


def test_a_frame_of_ardupilot_has_its_keys_in_its_order(cpfls, vehicle_file, tmp_path):
    output = cpfls.made("export", vehicle_file, "--format", "ardupilot", at=tmp_path / "uav.json")
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
    cpfls.done("export", tmp_path / "light.h5", "--format", "px4", "-o", tmp_path / "uav.sdf")
    text = " ".join((tmp_path / "uav.airframe").read_text().replace("#", " ").split())
    assert "param set-default MPC_THR_HOVER 0.1 " in text + " "
    assert "outside PX4's range of 0.1 to 0.8" in text


def test_an_identified_model_is_exported_as_a_vehicle(cpfls, pipeline, tmp_path):
    result = cpfls.done("export", pipeline.model, "--format", "casadi", "-o", tmp_path / "quad.py", "--force")
    assert "CasADi holds all of it." in result.stdout
    assert "inertia over attitude" not in result.stdout


def test_what_a_target_cannot_hold_at_all(refuse, tmp_path):
    path = write_vehicle(tmp_path / "hexa.h5", vehicle_of(replace(whole(HEXA), effects=(), remainder=None)))
    assert refuse("export", path, "--format", "rotorpy", "-o", tmp_path / "uav.py") == [
        f"{path.name}: RotorPy allocates thrust and torque to four rotors, but this vehicle has 6; --format mjcf, sdf, "
        "jax and casadi take any number"
    ]
    assert not (tmp_path / "uav.py").exists()
    for form, words in (
        ("crazyflow", "crazyflow and drone-models mix four"),
        ("urdf", "turns four rotors, two each way"),
    ):
        (line,) = refuse("export", path, "--format", form, "-o", tmp_path / f"uav{FORMS[form].ending}")
        assert words in line


@pytest.mark.parametrize("ending", ["xml", "c"])
def test_a_vehicle_that_should_not_be_used(cpfls, refuse, vehicle_file, tmp_path, monkeypatch, ending):
    monkeypatch.setattr(Vehicle, "verdict", "do-not-use")
    output = tmp_path / f"uav.{ending}"
    (line,) = refuse("export", vehicle_file, "-o", output)
    assert line == f"{vehicle_file}: its verdict is do-not-use; --anyway exports it, marked as such"
    result = cpfls.done("export", vehicle_file, "-o", output, "--force")
    mark = "DO NOT USE: this is the verdict on the model"
    assert mark in result.stdout
    assert mark in output.read_text()[:600]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("impossible")
    (folder / "study.yaml").write_text(STUDY)
    heavy = crossed(1.2, 0.16, (1.28, 0.012, 0.02), 1.0e-5, 1.6e-7, 900.0)
    write_vehicle(folder / "vehicle.h5", found_vehicle(heavy), STUDY)
    return folder


def report(cpfls, folder, form):
    page = folder / f"page.{form}"
    cpfls.done("report", folder / "study.yaml", folder / "vehicle.h5", "-o", page, "--format", form, "--force")
    return page.read_text()


def test_a_report_strikes_the_number_through_in_all_forms(cpfls, folder):
    assert "<s>Ixx 1.280</s> impossible" in report(cpfls, folder, "html")
    assert "~~Ixx 1.280~~ impossible" in report(cpfls, folder, "md")
    text = report(cpfls, folder, "json")
    assert "Ixx 1.280 impossible" in text
    assert "~~" not in text


@pytest.mark.parametrize(("command", "output"), [("export", "v.c"), ("export", "v.xml"), ("spread", "s.yaml")])
def test_no_export_holds_it_unless_it_is_asked_for(cpfls, folder, tmp_path, command, output):
    refused = cpfls(command, folder / "vehicle.h5", "-o", tmp_path / output, "--force")
    assert refused.exit_code == 2
    assert f"impossible numbers, which no such vehicle has: {HEAVY}" in refused.stderr
    assert "--anyway exports" in refused.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("output", ["v.c", "v.py", "v.xml", "v.sdf", "v.urdf", "v.toml"])
def test_who_asks_for_it_reads_it_first(cpfls, folder, tmp_path, output):
    form = ("--format", "jax") if output == "v.py" else ()
    result = cpfls.done("export", folder / "vehicle.h5", "-o", tmp_path / output, *form, "--anyway")
    assert f"IMPOSSIBLE NUMBERS, which no such vehicle has: {HEAVY}." in result.stdout
    written = (tmp_path / output).read_text()
    assert written.index("IMPOSSIBLE NUMBERS") < written.index("Vehicle: 1.2 kg")
    if output == "v.c":
        answer = cpfls.summary("export", folder / "vehicle.h5", "-o", tmp_path / output, "--anyway", "--force")
        assert answer["impossible"] == HEAVY
