"""`cpfls export` of a whole vehicle: the files it writes, and what it refuses."""

import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.playback.motion import State
from cpfls_cli.playback.player import one_step
from tests.builders.artifacts import edited
from tests.builders.compiled_c import build, require_gcc
from tests.builders.vehicle_models import QUAD, is_held, polynomial_effects, vehicle_of, whole, write_vehicle

ENDINGS = {"json": "json", "c": "c"}


@pytest.fixture
def vehicle(tmp_path):
    path = tmp_path / "vehicle.h5"
    write_vehicle(path, vehicle_of(whole(effects=polynomial_effects(QUAD)[:2])))
    return path


def self_test(output):
    """Run the self-test of exported source."""
    require_gcc()
    command = [build(output.parent, [output.name], "-DCPFLS_SELF_TEST", output="self-test")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("form", ENDINGS)
def test_a_vehicle_is_exported(cpfls, vehicle, tmp_path, form):
    output = tmp_path / "out" / f"quad.{ENDINGS[form]}"
    output.parent.mkdir()
    result = cpfls("export", vehicle, "-o", output, "--json")
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    summary = json.loads(result.stdout)
    assert sorted(summary["output"]) == sorted(str(path) for path in output.parent.iterdir())
    assert (summary["format"], summary["name"], summary["rotors"], summary["learned"]) == (form, "quad", 4, True)
    assert summary["effects"] == ["linear_damping", "quadratic_damping"]
    if form == "json":
        document = json.loads(output.read_text())
        assert document["format"] == "cpfls/model-json"
        learned = document["learned"]["coefficients"]
        assert len(document["numbers"]) + len(learned) == summary["weights"]
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
        "NOT JUDGED: not judged as a forecast; its constants are identified; 1 of 2 numbers are not determined."
    )
    assert whole_of_it == "JAX holds all of it."
    assert effects in (tmp_path / "quad.py").read_text()


@pytest.mark.parametrize("form", ENDINGS)
def test_what_an_export_cannot_hold_is_named_on_the_screen_and_in_the_file(cpfls, tmp_path, form):
    path, output = tmp_path / "vehicle.h5", tmp_path / f"m.{ENDINGS[form]}"
    none = np.zeros(0)
    beside = ModelEffect("ground_effect", {"G": 1.2}, none), ModelEffect("battery_sag", {"exponent": 1.5}, none)
    model = replace(whole(effects=beside, remainder=None), wind=(3.0, 0.5, 0.0))
    write_vehicle(path, vehicle_of(model))
    result = cpfls("export", path, "-o", output, "--json")
    assert result.exit_code == 0, result.stderr
    titles = [each["title"] for each in json.loads(result.stdout)["missing"]]
    # Nothing of this vehicle meets the air, so that the wind does nothing.
    assert [title.partition(" (")[0] for title in titles] == ["battery sag", "ground effect"]
    assert titles[0].endswith("; exponent = 1.5)")
    said = cpfls("export", path, "-o", output, "--force").stdout.splitlines()
    assert said[-2:] == [
        f"Not held: {' '.join(title.split())}; its size depends on the flight and was not measured along one."
        for title in titles
    ]
    written = " ".join(output.read_text().replace("\n *", " ").replace("\n#", " ").split())
    assert all(" ".join(sentence.split()) in written for sentence in said[-2:])
    if form != "json":
        assert self_test(output).returncode == 0


def test_a_vehicle_of_wrong_content_is_refused(refuse, vehicle, tmp_path):
    with edited(vehicle) as file:
        names = np.char.encode(np.array(["linear_damping", "quadratic_dampin"]), "utf-8")
        del file["model/effects/name"]
        file["model/effects/name"] = names
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
        assert cpfls(*line.split("#")[0].split()[1:]).exit_code == 0, line
    (tmp_path / "main.c").write_text(FLIGHT)
    (tmp_path / "predict.c").write_text(code)
    program = build(tmp_path, ["main.c", "predict.c", "uav.c"])
    said = [float(word) for word in subprocess.run([program], capture_output=True, check=True).stdout.split()]
    speed = (1000.0 + 7 * (np.arange(80) % 13)).reshape(20, 4)
    state = State(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), np.eye(3)[None], np.zeros((1, 3)))
    for row in model.response.terms_by_step(speed, 0.01, "previous"):
        state = one_step(model, state, row[None], 0.01)
    wanted = [0, state.position[0, 0], state.velocity[0, 2], state.rate[0, 1]]
    np.testing.assert_allclose(said, wanted, rtol=1e-9)


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
