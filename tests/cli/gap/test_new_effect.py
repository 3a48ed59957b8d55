"""A new effect is one file: simulated, found, named, exported to C and played back without any other line."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pytest

from tests.builders.compiled_c import WARNINGS, require_gcc
from tests.builders.studies import VEHICLE, put_file

EFFECT = '''\
"""Rotational damping that grows with the cube of the rate."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    return Wrench(tuple(-p[f"d_{axis}"] * rate**3 for axis, rate in zip("xyz", see.body_rate, strict=True)))


EFFECT = Effect(
    name="cubic_damping",
    order=10_000,
    title="cubic rotational damping",
    kind="wrench",
    formula="M = -(d_x p^3, d_y q^3, d_z r^3)",
    sentence="Something brakes fast rotation far more than slow rotation.",
    coefficients=of_axes("d_{}", "N m s^3/rad^3", 0.0, 1.0, "damping about {}", scales.MOMENTS),
    needs=frozenset(),
    excitation="roll, pitch and yaw rate sweeps at a small and at a large amplitude",
    rivals={"quadratic_damping": "repeat the same rate sweep at twice the amplitude"},
    source="a drawn example",
    acts=_acts,
)
'''
STUDY = (
    """\
trajectory: {path: straight, legs: 3, displacement_m: 8.0, period_s: 0.4, duration_s: 20.0, yaw_turn_rad: 12.5}
simulation:
  mode: closed-loop
  noise: {attitude: 0.003, body_rate: 0.005, position: 0.02, velocity: 0.05, acceleration: 0.1, rotor_speed: 1.0}
"""
    + VEHICLE
)
# The catalogue is read once in a process, so a process of its own sees one more file of it.
PROGRAM = """
import json, sys
from cpfls_cli.effects import catalogue
catalogue.__path__.append(sys.argv[1])
from typer.testing import CliRunner
from cpfls_cli.cli.stages import app
for words in json.loads(sys.argv[2]):
    result = CliRunner().invoke(app, words)
    print(json.dumps([result.exit_code, result.stdout, result.stderr]))
"""


@pytest.fixture(scope="module")
def new(tmp_path_factory):
    """The folder of a study with a new effect, and what each command said last, by its first word."""
    folder = tmp_path_factory.mktemp("new-effect")
    (folder / "effects").mkdir()
    put_file(folder / "effects" / "cubic_damping.py", EFFECT)
    put_file(folder / "study.yaml", STUDY)
    commands = []
    for number, towards in (("1", "[1.0, 1.0, 1.0]"), ("2", "[1.0, -0.6, 0.3]")):
        path, flight = f"path-{number}.h5", f"flight-{number}.h5"
        commands += [
            ["trajectory", "study.yaml", "--set", f"trajectory.direction={towards}", "-o", path],
            ["simulate", "study.yaml", path, "--seed", number, "--effect", "cubic_damping=0.3,0.3,0.3", "-o", flight],
        ]
    commands += [
        ["compare", "study.yaml", "flight-1.h5", "-o", "gap.h5"],
        ["diagnose", "study.yaml", "gap.h5", "--held-out", "flight-2.h5", "-o", "found.h5", "--json"],
        ["extend", "study.yaml", "found.h5", "-o", "extended.h5"],
        ["export", "extended.h5", "-o", "vehicle.c"],
        ["replay", "study.yaml", "extended.h5", "flight-2.h5", "-o", "replay.h5", "--every", "50", "--json"],
        ["effects"],
    ]
    words = (sys.executable, "-c", PROGRAM, folder / "effects", json.dumps(commands))
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [code for code, *_ in answers] == [0] * len(commands), answers
    said = {command[0]: out for command, (_, out, _) in zip(commands, answers, strict=True)}
    return SimpleNamespace(folder=folder, said=said)


def test_it_is_listed_and_flown(new):
    assert "cubic_damping" in new.said["effects"]
    assert "cubic_damping.d_z = 0.3" in new.said["simulate"]


def test_it_is_named_with_its_coefficients(new):
    found = json.loads(new.said["diagnose"])
    (effect,) = found["effects"]
    assert (found["verdict"], effect["name"]) == ("NAMED", "cubic_damping")
    about_yaw = effect["coefficients"]["d_z"]
    assert about_yaw["low"] < 0.3 < about_yaw["high"]
    assert about_yaw["value"] == pytest.approx(0.3, rel=0.05)


def test_it_is_in_the_exported_c(new):
    assert "static const real cubic_damping_d_z" in (new.folder / "vehicle.c").read_text()
    require_gcc()
    subprocess.run(["gcc", *WARNINGS, "-c", "vehicle.c", "-o", "vehicle.o"], cwd=new.folder, check=True)


def test_it_is_played_back(new):
    models = json.loads(new.said["replay"])["models"]
    own, stated = (models[name]["body_rate"]["rms"][-1] for name in ("model", "stated"))
    assert own < 0.5 * stated
