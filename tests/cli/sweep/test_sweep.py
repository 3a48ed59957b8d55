"""What a sweep finds is what the single commands find, one by one."""

import json

import h5py
import numpy as np
import pytest

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.store import read_artifact

SETTINGS = 3


def numbers(path, *names):
    with h5py.File(path) as file:
        return [np.asarray(file[name][()], dtype=float) for name in names]


def test_artifact_keeps_to_its_format(whole):
    sweep = read_artifact(whole)
    assert check_artifact(sweep) == []
    assert sweep.texts("setting/name") == ["classic, all samples", "fewer samples", "more functions"]
    assert sweep.texts("setting/criterion") == ["all", "D", "D"]
    assert sweep.array("setting/samples").tolist() == [275, 40, 60]
    assert sweep.array("setting/population").tolist() == [8, 8, 12]
    assert sweep.array("run/setting").tolist() == [0, 1, 2, 0, 1, 2]
    assert sweep.array("run/seed").tolist() == [5, 5, 5, 6, 6, 6]
    assert sweep.number("complete") == 1
    assert len(set(sweep.texts("setting/selection"))) == SETTINGS


@pytest.mark.parametrize(("setting", "seed"), [(0, 6), (1, 6), (2, 5)])
def test_each_run_is_that_of_identify_with_the_overrides_and_the_seed(
    cpfls, whole, sweep, sweep_flight, tmp_path, setting, seed
):
    artifact = read_artifact(whole)
    texts = json.loads(artifact.texts("setting/overrides")[setting])
    asked = [text for text in texts if text != "reduction.size=null"]
    # No evidence: a sweep gathers none, and none of it is compared.
    overrides = [word for text in (*asked, "identification.validation.enabled=false") for word in ("--set", text)]
    selection, model = tmp_path / "selection.h5", tmp_path / "model.h5"
    options = []
    if "reduction.size=null" not in texts:
        assert cpfls("reduce", sweep, sweep_flight, "-o", selection, *overrides).exit_code == 0
        options = ["--selection", selection]
    result = cpfls("identify", sweep, sweep_flight, *options, "-o", model, *overrides, "--seed", seed, "--json")
    assert result.exit_code == 0, result.stderr
    run = (seed - 5) * SETTINGS + setting
    found = json.loads(result.stdout)
    weights = numbers(model, "model/weights")[0]
    chromosome = artifact.array("run/chromosome")[run]
    assert chromosome[: len(weights)].tolist() == weights.tolist()
    assert (chromosome[len(weights) :] == -1).all()
    assert artifact.array("run/mse")[run, 0] == found["mse"]
    assert artifact.array("run/max_error")[run, 0] == found["max_error"]
    assert artifact.array("run/relative_error")[run, 0] == found["relative_error"]
    assert artifact.array("run/condition_number")[run] == found["condition_number"]
    assert artifact.array("run/evaluations")[run] == found["evaluations"]
    assert artifact.array("setting/samples")[setting] == found["learned"]


def test_printed_means_and_variances_are_those_of_the_runs(cpfls, words, whole, tmp_path):
    result = cpfls(*words, "-o", tmp_path / "again.h5", "--json")
    assert (tmp_path / "again.h5").read_bytes() == whole.read_bytes()
    summary = json.loads(result.stdout)
    assert (summary["runs"], summary["runs_in_all"], summary["complete"]) == (6, 6, True)
    mse, condition, setting = numbers(whole, "run/mse", "run/condition_number", "run/setting")
    for place, said in enumerate(summary["settings"]):
        first, second = mse[setting == place, 0]
        assert said["mse"]["mean"] == pytest.approx((first + second) / 2)
        assert said["mse"]["variance"] == pytest.approx((first - second) ** 2 / 2)
        assert said["mse"]["smallest"] == min(first, second)
        assert said["condition_number"]["mean"] == pytest.approx(sum(condition[setting == place]) / 2)
        assert said["seeds"] == [5, 6]
    table = cpfls(*words, "-o", tmp_path / "table.h5").stdout.splitlines()
    assert table[0] == "6 of 6 runs, 3 settings; mean and standard deviation of the training part"
    assert [line.split("  ")[0] for line in table[1:5]] == ["Setting", *(s["name"] for s in summary["settings"])]


def test_without_settings_the_study_itself_is_repeated(cpfls, words, tmp_path):
    output = tmp_path / "sweep.h5"
    options = ("--set", "sweep.settings=[]", "--set", "sweep.seeds=1", "--seed", 9)
    assert cpfls(*words, "-o", output, *options).exit_code == 0
    sweep = read_artifact(output)
    assert sweep.texts("setting/name") == ["as configured"]
    assert sweep.array("run/seed").tolist() == [9]
    assert sweep.array("setting/population").tolist() == [8]


def test_held_out_parts_and_other_flights_are_judged(cpfls, words, sweep, sweep_flight, tmp_path):
    other, output = tmp_path / "other.h5", tmp_path / "sweep.h5"
    noise = ("--set", "simulation.relative_noise={torque: 0.05}")
    assert cpfls("simulate", sweep, sweep_flight.with_name("trajectory.h5"), "-o", other, *noise).exit_code == 0
    settings = "[{name: split, set: {identification.training_share: 0.7}}, {name: whole}]"
    options = ("--set", f"sweep.settings={settings}", "--set", "sweep.seeds=1", "--validate", other)
    assert cpfls(*words, "-o", output, *options).exit_code == 0
    artifact = read_artifact(output)
    assert artifact.texts("part") == ["training", "held-out rest", "other.h5"]
    known = np.isfinite(artifact.array("run/mse"))
    assert known.tolist() == [[True, True, True], [True, False, True]]


def test_workers_find_the_same(cpfls, words, tmp_path):
    least = (
        "--set",
        "sweep.seeds=1",
        "--set",
        "sweep.settings=[{name: more}, {name: fewer, set: {reduction.size: 40}}]",
    )
    for count in (1, 2):
        result = cpfls(*words, "-o", tmp_path / f"{count}.h5", *least, "--workers", count)
        assert result.exit_code == 0, result.stderr
    assert (tmp_path / "1.h5").read_bytes() == (tmp_path / "2.h5").read_bytes()


def test_run_that_finds_nothing_is_told_and_counts_for_no_mean(cpfls, words, tmp_path, monkeypatch):
    from cpfls_cli.identification.search import NothingFoundError
    from cpfls_cli.search import sweep_runs

    calls, identify = [], sweep_runs.identify

    def sometimes(*arguments):
        calls.append(arguments)
        if len(calls) == 1:
            raise NothingFoundError("generations")
        return identify(*arguments)

    monkeypatch.setattr(sweep_runs, "identify", sometimes)
    result = cpfls(*words, "-o", tmp_path / "sweep.h5", "--json")
    assert result.exit_code == 0
    assert result.stderr == "cpfls: note: 1 of 6 runs found no finite model; all means leave them out\n"
    first = json.loads(result.stdout)["settings"][0]
    assert first["runs"] == 2
    assert first["mse"]["mean"] == first["mse"]["smallest"]
    assert first["mse"]["variance"] is None
    assert check_artifact(read_artifact(tmp_path / "sweep.h5")) == []


def test_dry_run_writes_nothing(cpfls, words, tmp_path):
    result = cpfls(*words, "-o", tmp_path / "sweep.h5", "--dry-run")
    assert result.exit_code == 0
    assert list(tmp_path.iterdir()) == []
