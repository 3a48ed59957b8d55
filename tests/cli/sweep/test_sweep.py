"""What a sweep finds is what the single commands find, one by one."""

import json

import h5py
import numpy as np
import pytest

from cpfls_cli.identification.replicates import Sweep
from cpfls_cli.result import column
from cpfls_cli.store import read

SETTINGS = 3


def sweep_in(path):
    return read(path, Sweep)[0]


def test_file_holds_every_setting_with_its_runs(whole):
    sweep = sweep_in(whole)
    assert column(sweep.settings, "name") == ["classic, all samples", "fewer samples", "more functions"]
    assert column(sweep.settings, "criterion") == ["all", "D", "D"]
    assert column(sweep.settings, "samples") == [275, 40, 60]
    assert column(sweep.settings, "population") == [8, 8, 12]
    assert [setting.seeds.tolist() for setting in sweep.settings] == [[5, 6]] * 3
    assert sweep.complete
    assert len(set(column(sweep.settings, "selection"))) == SETTINGS


@pytest.mark.parametrize(("setting", "seed"), [(0, 6), (1, 6), (2, 5)])
def test_each_run_is_that_of_identify_with_the_overrides_and_the_seed(
    cpfls, whole, sweep, sweep_flight, tmp_path, setting, seed
):
    own = sweep_in(whole).settings[setting]
    texts = own.overrides
    asked = [text for text in texts if text != "reduction.size=null"]
    # No evidence: a sweep gathers none, and none of it is compared.
    overrides = [word for text in (*asked, "identification.validation.enabled=false") for word in ("--set", text)]
    selection, model = tmp_path / "selection.h5", tmp_path / "model.h5"
    options = []
    if "reduction.size=null" not in texts:
        cpfls.done("reduce", sweep, sweep_flight, "-o", selection, *overrides)
        options = ["--selection", selection]
    found = cpfls.told("identify", sweep, sweep_flight, *options, "-o", model, *overrides, "--seed", seed)
    run = own.replicates[seed - 5]
    with h5py.File(model) as file:
        assert list(run.chromosome) == file["weights"][()].tolist()
    for name in ("mse", "max_error", "relative_error"):
        assert getattr(run, name)[0] == found[name]
    assert (run.condition_number, run.evaluations) == (found["condition_number"], found["evaluations"])
    assert own.samples == found["learned"]


def test_printed_means_and_variances_are_those_of_the_runs(cpfls, words, whole, tmp_path):
    result = cpfls(*words, "-o", tmp_path / "again.h5", "--json")
    assert (tmp_path / "again.h5").read_bytes() == whole.read_bytes()
    summary = json.loads(result.stdout)
    assert (summary["runs"], summary["runs_in_all"], summary["complete"]) == (6, 6, True)
    for own, said in zip(sweep_in(whole).settings, summary["settings"], strict=True):
        first, second = own.of("mse")
        assert said["mse"]["mean"] == pytest.approx((first + second) / 2)
        assert said["mse"]["variance"] == pytest.approx((first - second) ** 2 / 2)
        assert said["mse"]["smallest"] == min(first, second)
        assert said["condition_number"]["mean"] == pytest.approx(sum(own.of("condition_number")) / 2)
        assert said["seeds"] == [5, 6]
    table = cpfls(*words, "-o", tmp_path / "table.h5").stdout.splitlines()
    assert table[0] == "6 of 6 runs, 3 settings; mean and standard deviation of the training part"
    assert [line.split("  ")[0] for line in table[1:5]] == ["Setting", *(s["name"] for s in summary["settings"])]


def test_without_settings_the_study_itself_is_repeated(cpfls, words, tmp_path):
    output = tmp_path / "sweep.h5"
    options = ("--set", "sweep.settings=[]", "--set", "sweep.seeds=1", "--seed", 9)
    cpfls.done(*words, "-o", output, *options)
    (own,) = sweep_in(output).settings
    assert (own.name, own.seeds.tolist(), own.population) == ("as configured", [9], 8)


def test_held_out_parts_and_other_flights_are_judged(cpfls, words, sweep, sweep_flight, tmp_path):
    other, output = tmp_path / "other.h5", tmp_path / "sweep.h5"
    noise = ("--set", "simulation.relative_noise={torque: 0.05}")
    cpfls.done("simulate", sweep, sweep_flight.with_name("trajectory.h5"), "-o", other, *noise)
    settings = "[{name: split, set: {identification.training_share: 0.7}}, {name: whole}]"
    options = ("--set", f"sweep.settings={settings}", "--set", "sweep.seeds=1", "--validate", other)
    cpfls.done(*words, "-o", output, *options)
    sweep = sweep_in(output)
    assert sweep.parts == ("training", "held-out rest", "other.h5")
    known = [np.isfinite(own.replicates[0].mse).tolist() for own in sweep.settings]
    assert known == [[True, True, True], [True, False, True]]


def test_workers_find_the_same(cpfls, words, tmp_path):
    least = (
        "--set",
        "sweep.seeds=1",
        "--set",
        "sweep.settings=[{name: more}, {name: fewer, set: {reduction.size: 40}}]",
    )
    for count in (1, 2):
        cpfls.done(*words, "-o", tmp_path / f"{count}.h5", *least, "--workers", count)
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
    result = cpfls.done(*words, "-o", tmp_path / "sweep.h5", "--json")
    assert result.stderr == "cpfls: note: 1 of 6 runs found no finite model; all means leave them out\n"
    first = json.loads(result.stdout)["settings"][0]
    assert first["runs"] == 2
    assert first["mse"]["mean"] == first["mse"]["smallest"]
    assert first["mse"]["variance"] is None
    assert sweep_in(tmp_path / "sweep.h5").without_model == 1
