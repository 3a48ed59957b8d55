"""Full rotations of a held vehicle, from the path to a model, through the commands."""

import json

import h5py
import numpy as np
import pytest

from tests.builders.studies import VEHICLE

HELD = """\
seed: {seed}
trajectory: {{path: {path}, duration_s: 12.0, sample_time_s: 0.05, rotation: {{starts: 2, iterations: 3}}}}
reduction: {{size: 60}}
identification:
  input_map: full-circle
  consequents: harmonic
  harmonic_order: 2
  products: tensor
  membership_functions: 1
  base: none
"""


@pytest.fixture
def study(tmp_path):
    def write(path="full-rotation", seed=1):
        config = tmp_path / f"{path}-{seed}.yaml"
        config.write_text(HELD.format(path=path, seed=seed) + VEHICLE.replace("[0.6, 0.6, 1.2]", "[0.06, 0.05, 0.08]"))
        return config

    return write


@pytest.mark.usefixtures("drawn")
def test_a_held_vehicle_has_no_position(cpfls, tmp_path, study):
    planned = cpfls.done("trajectory", study(), "-o", tmp_path / "t.h5", "--plot")
    assert "held at its centre of mass" in planned.stdout
    assert ">yaw</" in (tmp_path / "t-rotation.svg").read_text()
    with h5py.File(tmp_path / "t.h5") as file:
        assert "position" not in file
        turned = np.ptp(file["attitude"][:], axis=0)
    assert turned.min() > np.pi
    cpfls.done("check", tmp_path / "t.h5")
    cpfls.done("report", study(), tmp_path / "t.h5", "-o", tmp_path / "r.html")


def test_optimised_says_what_the_path_is_worth(cpfls, tmp_path, study):
    told = cpfls.told("trajectory", study("optimised"), "-o", tmp_path / "t.h5")
    assert told["condition_number"] <= told["random"]["best"] <= told["random"]["median"]
    assert told["evaluations"] == 5


@pytest.mark.usefixtures("drawn")
def test_a_model_learned_on_full_rotations_holds_on_another_one(cpfls, tmp_path, study):
    for seed in (1, 2):
        t, f = tmp_path / f"t{seed}.h5", tmp_path / f"f{seed}.h5"
        cpfls.done("trajectory", study(seed=seed), "-o", t)
        cpfls.done("simulate", study(seed=seed), t, "-o", f)
    found = cpfls.done(
        *("identify", study(), tmp_path / "f1.h5", "--validate", tmp_path / "f2.h5", "-o", tmp_path / "m.h5", "--json")
    )
    assert json.loads(found.stdout)["held_out"]["f2.h5"]["relative_error"] < 1e-8
    cpfls.done("report", study(), tmp_path / "f1.h5", "-o", tmp_path / "r.html")
    assert "Attitude and Euler rates of f1.h5" in (tmp_path / "r.html").read_text()


def test_what_a_held_vehicle_lacks_has_no_noise(cpfls, refuse, tmp_path, study):
    cpfls.done("trajectory", study(), "-o", tmp_path / "t.h5")
    noise = ("--set", "simulation.noise={position: 0.5}")
    (message,) = refuse("simulate", study(), tmp_path / "t.h5", "-o", tmp_path / "f.h5", *noise)
    assert "simulation.noise" in message
    assert "position: a vehicle held at its centre of mass has none" in message


def test_no_autopilot_flies_a_held_vehicle(cpfls, refuse, tmp_path, study):
    cpfls.done("trajectory", study(), "-o", tmp_path / "t.h5")
    command = ("simulate", study(), tmp_path / "t.h5", "-o", tmp_path / "f.h5", "--mode", "closed-loop")
    (message,) = refuse(*command)
    assert "turns a vehicle that is held at its centre of mass" in message


def test_turns_that_no_rotor_gives_name_the_torque_to_limit(refuse, tmp_path, study):
    heavy = ("--set", "vehicle.inertia_kg_m2=[6, 6, 12]")
    messages = refuse("trajectory", study(), "-o", tmp_path / "t.h5", *heavy, code=1)
    assert any("M1: above the limit asked for" in message for message in messages)
    assert (
        "trajectory.rotation.torque_max_n_m (about one axis at a time the rotors give up to 36.4 36.5 5.4 N m)"
        in messages[-1]
    )


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("rotation.rate_max_rad_s", "1e-3", "turn"),
        ("rotation.frequency_max_hz", "1e-3", "no harmonic fits into 12 s"),
        ("rotation.turns", "[100, 0, 0]", "turn"),
        ("duration_s", "null", "path full-rotation needs a duration"),
    ],
)
def test_impossible_rotations_name_their_key(refuse, tmp_path, study, key, value, complaint):
    config = study()
    (message,) = refuse("trajectory", config, "-o", tmp_path / "t.h5", "--set", f"trajectory.{key}={value}")
    assert f"trajectory.{key.rsplit('.', 1)[0]}" in message
    assert complaint in message
