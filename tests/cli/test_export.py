"""`cpfls export`: the files it writes, what it refuses, and that nothing in a model can break into its code."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.validation.verdict import Reason, Verdict
from tests.builders.artifacts import edited, with_fields
from tests.builders.exported_vehicles import on_numpy
from tests.builders.playback_flights import truth
from tests.builders.vehicle_models import vehicle_of, write_vehicle

HOSTILE = '*/ int main(void) { return 7; } /* ??/\n"""\nraise SystemExit(7)\n#error " \\ \u202e'
ENDINGS = {"json": "json", "c": "c"}


@pytest.fixture
def model(pipeline, tmp_path):
    """A model to change."""
    path = tmp_path / "model.h5"
    shutil.copy(pipeline.model, path)
    return path


def change(path, **values):
    with edited(path) as file:
        for name, value in values.items():
            place = name.replace("__", "/")
            if place in file:
                del file[place]
            if value is not None:
                file[place] = np.char.encode(value, "utf-8") if np.asarray(value).dtype.kind == "U" else value


def compile_and_test(source, folder):
    if shutil.which("gcc") is None:
        pytest.skip("no gcc on this machine")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    command = ["gcc", *strict, "-DCPFLS_SELF_TEST", source, "-lm", "-o", folder / "self-test"]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return subprocess.run([folder / "self-test"], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("form", ENDINGS)
def test_the_model_of_a_study_is_exported(cpfls, pipeline, tmp_path, form):
    output = tmp_path / f"quad.{ENDINGS[form]}"
    result = cpfls.done("export", pipeline.model, "--format", form, "-o", output, "--json")
    assert result.stderr == ""
    summary = json.loads(result.stdout)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == (["quad.c", "quad.h"] if form == "c" else [output.name])
    assert sorted(summary["output"]) == [str(tmp_path / name) for name in files]
    assert summary["bytes"] == sum(path.stat().st_size for path in tmp_path.iterdir())
    assert (summary["format"], summary["name"], summary["complete"]) == (form, "quad", True)
    if form == "json":
        document = json.loads(output.read_text())
        assert document["provenance"]["config"]["identification"]["membership_functions"] == 5
        assert document["provenance"]["inputs"]["flight"]["name"] == "flight.h5"
        assert set(document["judged"]["models"]) >= {"model", "rigid-body"}
    if form == "c":
        done = compile_and_test(output, tmp_path)
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("form", ENDINGS)
def test_an_incomplete_model_is_refused_and_marked_with_force(cpfls, refuse, model, tmp_path, form):
    change(model, stop_reason=np.array("time-limit"))
    output = tmp_path / f"m.{ENDINGS[form]}"
    words = ("export", model, "--format", form, "-o", output)
    assert refuse(*words) == [
        f"{model}: the search for this model did not come to its end (time-limit); `cpfls identify ... --resume` goes "
        "on, --anyway exports the model as it is, marked as incomplete"
    ]
    result = cpfls.done(*words, "--force", "--json")
    assert json.loads(result.stdout)["complete"] is False
    assert result.stderr == "cpfls: note: the model is incomplete, and marked as such: do not fly with it\n"
    text = output.read_text()
    if form == "json":
        assert json.loads(text)["complete"] is False
    else:
        assert "INCOMPLETE MODEL: its search did not run to the end (time-limit)." in text[:400]
    if form == "c":
        assert "#define M_COMPLETE 0\n" in output.with_suffix(".h").read_text()


@pytest.mark.parametrize("form", ENDINGS)
def test_hostile_text_in_a_model_stays_text(cpfls, model, tmp_path, form):
    hostile = tmp_path / ("x*" + "' \"; raise SystemExit(8)\n#.h5")
    with edited(model) as file:
        texts = file["verdict/reasons/text"]
        file["verdict/reasons/text"][...] = np.full(texts.shape, HOSTILE.encode()[: texts.dtype.itemsize])
    change(
        model,
        findings=np.array([HOSTILE]),
        verdict__label=np.array(HOSTILE),
        verdict__region=np.array(HOSTILE),
        stop_reason=np.array(HOSTILE),
    )
    with edited(model) as file:
        file["inputs/flight"].attrs["name"] = HOSTILE
    model.rename(hostile)
    output = cpfls.made("export", hostile, "--format", form, "--force", at=tmp_path / f"m.{ENDINGS[form]}")
    if form == "json":
        document = json.loads(output.read_text())
        assert document["verdict"]["label"] == document["findings"][0] == HOSTILE
        assert document["provenance"]["model"]["name"] == hostile.name
    elif form == "c":
        assert compile_and_test(output, tmp_path).returncode == 0
    else:
        done = subprocess.run([sys.executable, "-I", output], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_a_config_is_no_model(refuse, study, tmp_path):
    (line,) = refuse("export", study, "--format", "json", "-o", tmp_path / "m.json")
    assert line == f"{study}: is a config, and this takes what cpfls made; `cpfls config {study}` shows it"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"model__fuzzy__partitions__values__values": np.full(30, 2.0)},
            "model/fuzzy/partitions: those of D13(pitch) make no partition; identify it again",
        ),
        (
            {"model__fuzzy__partitions__values__values": np.linspace(1.0, 0.0, 30)},
            "model/fuzzy/partitions: those of D13(pitch) make no partition; identify it again",
        ),
        (
            {"model__fuzzy__visited": np.zeros((71, 71), dtype=bool)},
            "model/fuzzy/visited: is (71, 71), not (72, 72); identify it again",
        ),
        (
            {"model__fuzzy__coefficients": np.full(113, np.inf)},
            "model/fuzzy/coefficients: 113 of 113 values are not finite",
        ),
        ({"model__fuzzy__rigid_body": None}, "the cpfls/identified lacks /model/fuzzy/rigid_body; make it again"),
    ],
)
def test_a_model_of_wrong_content(refuse, model, tmp_path, values, message):
    change(model, **values)
    assert refuse("export", model, "--format", "c", "-o", tmp_path / "m.c")[0].startswith(f"{model}: {message}")


def test_output_rules(cpfls, refuse, model, tmp_path):
    words = ("export", model, "--format", "c", "-o", tmp_path / "m.c")
    (tmp_path / "m.h").write_text("precious")
    assert refuse(*words) == [f"{tmp_path / 'm.h'}: exists already; --force replaces it"]
    assert refuse(*words, "--dry-run") == [f"{tmp_path / 'm.h'}: exists already; --force replaces it"]
    assert cpfls(*words, "--force", "-q").stdout == ""
    assert "precious" not in (tmp_path / "m.h").read_text()
    assert refuse(*words) == [f"{tmp_path / 'm.c'}: exists already; --force replaces it"]
    for form, ending in ENDINGS.items():
        missing = tmp_path / "none" / f"m.{ending}"
        (line,) = refuse("export", model, "--format", form, "-o", missing)
        assert line == f"{missing}: cannot write into the folder {missing.parent}: No such file or directory"
    for form, name, ending in (("c", "n.h", ".c"), ("json", "n.h5", ".json")):
        (line,) = refuse("export", model, "--format", form, "-o", tmp_path / name)
        assert line == f"{tmp_path / name}: --format {form} writes a file that ends in {ending}; name it so"
    (line,) = refuse("export", model, "--format", "c", "-o", tmp_path / 'a"b.c')
    assert line.endswith("C includes its header by name; use letters, digits and any of _ . + - in it")


def test_names(cpfls, refuse, pipeline, tmp_path):
    words = ("export", pipeline.model, "--format", "c", "-o", tmp_path / "2-m.c")
    cpfls.done(*words)
    assert "unsigned model_2_m_inertia(" in (tmp_path / "2-m.h").read_text()
    cpfls.done(*words, "--force", "--name", "Quad_7")
    assert "#define QUAD_7_OUTSIDE 1u" in (tmp_path / "2-m.h").read_text()
    (line,) = refuse(*words, "--force", "--name", "x; int y")
    assert line == "--name x; int y: not an identifier; use letters, digits and underscores, a letter first"


def test_a_name_goes_to_c_and_json_only(cpfls, refuse, pipeline, tmp_path):
    words = ("export", pipeline.model, "--name", "uav", "-o")
    (line,) = refuse(*words, tmp_path / "m.py", "--format", "jax")
    assert line == "--name uav: a Python module is named after its file; leave --name out, or rename -o"
    for form, ending, whose in (("pyflyt", "urdf", "a model of PyFlyt"), ("webots", "proto", "a PROTO of Webots")):
        (line,) = refuse(*words, tmp_path / f"m.{ending}", "--format", form)
        assert line == f"--name uav: {whose} is named after its file; leave --name out, or rename -o"
    cpfls.done(*words, tmp_path / "m.json")
    assert json.loads((tmp_path / "m.json").read_text())["name"] == "uav"


@pytest.mark.parametrize("form", ENDINGS)
def test_the_suffix_shows_the_form(cpfls, pipeline, tmp_path, form):
    output = tmp_path / f"m.{ENDINGS[form]}"
    assert json.loads(cpfls("export", pipeline.model, "-o", output, "--json").stdout)["format"] == form
    answer = tmp_path / "told" / output.name
    answer.parent.mkdir()
    cpfls.done("export", pipeline.model, "--format", form, "-o", answer)
    assert answer.read_bytes() == output.read_bytes()


def test_a_suffix_that_shows_no_form(refuse, pipeline, tmp_path):
    assert refuse("export", pipeline.model, "-o", tmp_path / "m.h") == [
        f"{tmp_path / 'm.h'}: its suffix names no form; give the name one of the suffixes .json (json), .c (c), "
        ".xml (mjcf), .sdf (sdf), .toml (crazyflow), .urdf (urdf), .proto (webots), .mcap (mcap), .csv (csv)"
    ]
    (line,) = refuse("export", pipeline.model, "-o", tmp_path / "m.py")
    assert line == f"{tmp_path / 'm.py'}: rotorpy, pegasus, casadi and jax write Python; name one of them with --format"


@pytest.mark.parametrize(
    ("stem", "instead"),
    [
        ("class", "class_model"),
        ("a b", "a_b_model"),
        ("2-m", "model_2_m_model"),
        ("numpy", "numpy_model"),
        ("json", "json_model"),
    ],
)
def test_a_module_that_nobody_could_import(cpfls, refuse, pipeline, tmp_path, stem, instead):
    output = tmp_path / f"{stem}.py"
    (line,) = refuse("export", pipeline.model, "--format", "jax", "-o", output)
    assert line.startswith(f"{output}: Python cannot import a module of this name; use letters, digits and _")
    assert line.endswith(f"such as {instead}.py")
    cpfls.done("export", pipeline.model, "--format", "jax", "-o", tmp_path / f"{instead}.py")


@pytest.mark.parametrize("form", ENDINGS)
def test_a_model_without_verdict_is_said(cpfls, model, tmp_path, form):
    change(model, verdict=None)
    output = tmp_path / f"m.{ENDINGS[form]}"
    result = cpfls.done("export", model, "-o", output)
    assert result.stderr.startswith(f"cpfls: note: {model}: holds no verdict (")
    assert len(result.stderr.splitlines()) == 1
    assert "\nVerdict: none; the model holds no validation.\n" in result.stdout
    if form == "c":
        assert '#define M_VERDICT "none"\n' in output.with_suffix(".h").read_text()
    else:
        assert '"verdict": null' in output.read_text()


def test_a_model_that_was_judged_unfit_is_marked(cpfls, refuse, model, tmp_path):
    with_fields(
        model, model, verdict=Verdict("do-not-use", "", (Reason("it is fast", 1), Reason("it explains nothing", -1)))
    )
    (line,) = refuse("export", model, "-o", tmp_path / "m.c")
    assert line == f"{model}: its verdict is do-not-use; --anyway exports it, marked as such"
    assert not (tmp_path / "m.c").exists()
    result = cpfls.done("export", model, "-o", tmp_path / "m.c", "--force")
    assert "DO NOT USE: this is the verdict on the model" in (tmp_path / "m.c").read_text()
    assert result.stderr == (
        f"cpfls: note: {model}: its verdict is do-not-use, exported all the same: it explains nothing\n"
    )
    assert '#define M_VERDICT "do-not-use"\n' in (tmp_path / "m.h").read_text()


def test_formats_are_named(cpfls, pipeline, tmp_path):
    result = cpfls("export", pipeline.model, "--format", "rust", "-o", tmp_path / "m.rs")
    assert result.exit_code == 2
    assert "Invalid value for '--format': 'rust' is not one of 'json', 'c', 'sdf'" in result.stderr
    result = cpfls("export", pipeline.model, "--format", "sdff", "-o", tmp_path / "m.sdf")
    assert result.stderr.splitlines()[-1].startswith("Error: Invalid value for '--format': 'sdff' is not one of 'json'")
    assert result.stderr.endswith("'csv' (did you mean 'sdf'?)\n")


PAGE = Path(__file__).parents[2] / "docs" / "export.md"
FLIGHT = """
#include <stdio.h>
unsigned control(const double q[3], const double qd[3], const double wanted[3][3], double body[3]);
int main(void)
{
    const double q[3] = {0.1, 0.1, 6.2}, qd[3] = {0.1, 0.2, 0.3};
    const double there[3][3] = {{0.1, 0.1, 6.2}, {0.1, 0.2, 0.3}, {1.0, 2.0, 3.0}};
    const double turned[3][3] = {{0.1, 0.1, -0.0831853071795864769}, {0.1, 0.2, 0.3}, {1.0, 2.0, 3.0}};
    double body[3], again[3];
    const unsigned status = control(q, qd, there, body);
    control(q, qd, turned, again);
    printf("%u %.17g %.17g %.17g %.17g\\n", status, body[0], body[1], body[2], again[2]);
    return 0;
}
"""


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_the_controller_of_the_page_compiles_and_asks_for_the_torque_of_the_model(cpfls, pipeline, tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("no gcc on this machine")
    for form, name in (("c", "quad.c"), ("jax", "quad.py")):
        cpfls.done("export", pipeline.model, "--format", form, "-o", tmp_path / name)
    code, _ = blocks("c")
    (tmp_path / "control.c").write_text(code)
    (tmp_path / "main.c").write_text(FLIGHT)
    files = [tmp_path / name for name in ("quad.c", "control.c", "main.c")]
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", *files, "-lm", "-o", tmp_path / "fly"]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    said = subprocess.run([tmp_path / "fly"], capture_output=True, text=True, check=True).stdout.split()
    names = on_numpy((tmp_path / "quad.py").read_text())
    q, qd, qdd = np.array([[0.1, 0.1, 6.2], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])
    assert int(said[0]) in (0, 1)
    body = names["torque"](q, qd, qdd)[1]
    assert np.allclose([float(word) for word in said[1:4]], body, rtol=1e-12)
    # One turn further is no error at all.
    assert float(said[4]) == pytest.approx(body[2], rel=1e-9)


def test_the_commands_of_the_page_run(cpfls, pipeline, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(pipeline.model, tmp_path / "model.h5")
    write_vehicle(tmp_path / "vehicle.h5", vehicle_of(truth()))
    first, self_test, autopilots, _ = blocks("sh")
    for line in [*first.splitlines(), *autopilots.splitlines()]:
        words = line.split("#")[0].split()
        cpfls.done(*words[1:], "--force")
    assert "uav_torque" in (tmp_path / "quad.h").read_text()
    if shutil.which("cc"):
        assert subprocess.run(self_test, shell=True, check=False, capture_output=True).returncode == 0
