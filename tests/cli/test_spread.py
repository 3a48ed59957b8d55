"""`cpfls spread`: files that others read, the same bytes for the same seed, and what it refuses."""

import json

import numpy as np
import pytest
import yaml

from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.validation.trust import Trust
from tests.builders.spread_vehicles import found_record
from tests.builders.vehicle_models import write_vehicle

COUNT = 20


@pytest.fixture
def vehicle(tmp_path):
    return write_vehicle(tmp_path / "vehicle.h5", found_record())


def written(cpfls, vehicle, ending, *words):
    output = vehicle.with_name(f"spread.{ending}")
    return cpfls.done("spread", vehicle, "-n", str(COUNT), "-o", output, "--force", *words), output


def test_all_forms_hold_the_same(cpfls, vehicle):
    files = {ending: written(cpfls, vehicle, ending)[1] for ending in ("json", "yaml", "npz")}
    document = json.loads(files["json"].read_text())
    assert document == yaml.safe_load(files["yaml"].read_text())
    assert (document["not_determined"], document["verdict"]) == (["inertia.Izz"], "not-determined")
    assert document["ranges"]["inertia.Izz"]["determined"] is False
    assert document["ranges"]["gust.roll_size"]["unit"] == "N m"
    assert document["drawn"] == COUNT + sum(document["rejected"].values())
    with np.load(files["npz"], allow_pickle=False) as arrays:
        for name, values in document["samples"].items():
            assert np.array_equal(arrays[name], values)
            assert len(values) == COUNT
            assert name in document["units"]
        assert arrays["inertia_kg_m2"].shape == (COUNT, 3, 3)
        assert (arrays["thrust_factor_n_s2"].shape, arrays["parameters"].shape[0]) == ((COUNT, 4), COUNT)
        assert np.array_equal(arrays["parameters"][:, 0], arrays["mass_kg"])
        assert np.array_equal(arrays["parameters"][:, -1], arrays["delay_s"])
        assert json.loads(str(arrays["facts"]))["cautions"] == document["cautions"]
        low, value, high = arrays["ranges"][list(arrays["range_names"]).index("thrust_factor")]
        assert low < value < high


@pytest.mark.parametrize("ending", ["json", "yaml", "npz"])
def test_the_same_seed_gives_the_same_bytes(cpfls, vehicle, ending):
    first, second, other = (written(cpfls, vehicle, ending, "--seed", seed)[1].read_bytes() for seed in ("3", "3", "4"))
    assert first == second
    assert first != other


def test_the_first_screen(cpfls, vehicle):
    result, output = written(cpfls, vehicle, "yaml")
    lines = result.stdout.splitlines()
    assert len(lines) <= 15
    assert max(map(len, lines[2:])) <= 150
    assert lines[0] == f"{output}: written ({output.stat().st_size} bytes)"
    assert lines[1].startswith(
        f"{COUNT} vehicles drawn from vehicle.h5 with seed 1. Verdict on the model: constants not"
    )
    assert "draws, because no vehicle has such numbers: " in lines[2]
    assert "Not determined, because the flights say too little about it: Izz." in result.stderr
    summary = json.loads(written(cpfls, vehicle, "yaml", "--json")[0].stdout)
    assert (summary["vehicles"], summary["ranges"]["lag.time_constant_s"]["value"]) == (COUNT, 0.035)


def test_a_model_that_lacks_an_effect_is_said_to_spread_too_little(cpfls, vehicle, monkeypatch):
    monkeypatch.setattr(Vehicle, "verdict", Trust.LACKING)
    result, output = written(cpfls, vehicle, "json")
    assert "the model lacks, so the spread is too narrow" in result.stderr
    assert json.loads(output.read_text())["verdict"] == Trust.LACKING


def test_what_the_model_lacks_is_in_the_file_with_the_parameters_of_its_parts(cpfls, vehicle, monkeypatch):
    monkeypatch.setattr(Vehicle, "verdict", Trust.LACKING)
    write_vehicle(vehicle, found_record(lack=[0.3, 0.2]))
    result, output = written(cpfls, vehicle, "npz")
    assert "the model lacks: the file holds how large that is" in result.stderr
    with np.load(output, allow_pickle=False) as arrays:
        assert arrays["lack_part"].tolist() == ["rotors", "linear_damping"]
        assert arrays["lack_share"].tolist() == [[0.3] * 3 + [0.0] * 3, [0.2] * 3 + [0.0] * 3]
        assert arrays["gust_torque_white_n_m_sqrt_s"].min() > 0
        # Each part is the whole vehicle with the shares of the others at 0: side by side they are the estimate.
        rotors, damping = arrays["lack_parameters"]
        apart = rotors != damping
        assert apart.sum() == 2
        assert (rotors + damping)[apart].tolist() == [1.0, 1.0]
        assert not (rotors * damping)[apart].any()
        facts = {name: arrays[f"lack_{name}"].tolist() for name in ("rest", "memory_s")}
    document = json.loads(written(cpfls, vehicle, "json")[1].read_text())["lack"]
    assert document["share"] == {"rotors": [0.3] * 3 + [0.0] * 3, "linear_damping": [0.2] * 3 + [0.0] * 3}
    assert {name: document[name] for name in facts} == facts
    assert "root of rest^2" in document["how_to_play"]


def test_guesses_are_held_and_named(cpfls, tmp_path):
    path = write_vehicle(tmp_path / "vehicle.h5", found_record(guessed=("drag_factor",), disturbance=None, gusts=False))
    result, output = written(cpfls, path, "json")
    assert "Not drawn, because it is a guess and no flight identifies it: drag factor." in result.stderr
    assert (
        "No gusts about roll, pitch and yaw and along x, y and z: the flights do not identify their size"
        in result.stderr
    )
    document = json.loads(output.read_text())
    assert document["held_at_guesses"] == ["drag_factor"]
    assert document["gusts"] is None
    assert not [name for name in document["samples"] if name.startswith("gust")]


def test_nothing_is_drawn_or_written_on_a_dry_run(cpfls, vehicle, monkeypatch):
    def never(*_):
        raise AssertionError("nothing is computed")

    monkeypatch.setattr("cpfls_cli.stages.spread.drawn", never)
    result = cpfls.done("spread", vehicle, "-o", vehicle.with_name("s.json"), "-n", "5", "--dry-run")
    assert "s.json: would be written; all inputs are good 5 vehicles would be drawn from" in " ".join(
        (result.stdout + result.stderr).split()
    )
    assert not vehicle.with_name("s.json").exists()


def test_what_is_refused(refuse, vehicle, pipeline, tmp_path, monkeypatch):
    (line,) = refuse("spread", vehicle, "-o", tmp_path / "s.csv")
    assert line.endswith("s.csv: its suffix names no form; give the name one of the suffixes .yaml, .json, .npz")
    (line,) = refuse("spread", pipeline.model, "-o", tmp_path / "s.json", "--force")
    assert "is a model of `cpfls identify`, which holds no covariance of its numbers; `cpfls vehicle` finds" in line
    monkeypatch.setattr(Vehicle, "verdict", "do-not-use")
    (line,) = refuse("spread", vehicle, "-o", tmp_path / "s.json")
    assert "its verdict is do-not-use" in line
