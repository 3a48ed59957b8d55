"""When a sweep may go on, start again, or replace what lies there; and settings that are wrong."""

import shutil

import pytest

from tests.builders.command_line import act_at_evaluation, interrupt_this_process


@pytest.fixture(scope="module")
def stopped_once(cpfls, words, tmp_path_factory):
    """The folder of an incomplete sweep with its first runs; nobody writes into it."""
    folder = tmp_path_factory.mktemp("stopped")
    with pytest.MonkeyPatch.context() as monkeypatch:
        act_at_evaluation(monkeypatch, 60, interrupt_this_process)
        assert cpfls(*words, "-o", folder / "sweep.h5").exit_code == 130
    return folder


@pytest.fixture
def stopped(stopped_once, tmp_path):
    """An incomplete sweep with its first runs."""
    shutil.copytree(stopped_once, tmp_path, dirs_exist_ok=True)
    return tmp_path / "sweep.h5"


def test_nothing_to_resume(refuse, words, tmp_path):
    (line,) = refuse(*words, "-o", tmp_path / "sweep.h5", "--resume")
    assert line == f"{tmp_path / 'sweep.h5'}.partial: no such file, so nothing to resume; start without --resume"


def test_finished_runs_of_which_nothing_is_said(refuse, words, stopped):
    (line,) = refuse(*words, "-o", stopped)
    assert line == (
        f"{stopped}.partial: a sweep for {stopped} was stopped here; --resume continues it, --force starts again"
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--seed", 2), "seed = 5 there, 2 here"),
        (("--set", "identification.generations=3"), "identification.generations = 2 there, 3 here"),
        (("--set", "reduction.criterion=A"), "reduction.criterion = D there, A here"),
        (("--set", "sweep.settings=[]"), "sweep.settings = "),
        (("--set", "sweep.seeds=1", "--set", "sweep.set={}"), "sweep.set = "),
    ],
)
def test_other_sweep(refuse, words, stopped, options, said):
    (line,) = refuse(*words, "-o", stopped, "--resume", *options)
    assert line.startswith(f"{stopped}.partial: belongs to another sweep: ")
    assert said in line


def test_fewer_seeds_than_are_finished(cpfls, refuse, words, tmp_path, interrupt_at):
    output = tmp_path / "sweep.h5"
    interrupt_at(90)
    assert cpfls(*words, "-o", output).exit_code == 130
    (line,) = refuse(*words, "-o", output, "--resume", "--set", "sweep.seeds=1")
    assert "sweep.seeds = 1, but " in line


def test_samples_that_cannot_be_chosen_name_the_setting(refuse, words, tmp_path):
    settings = "sweep.settings=[{name: tiny, set: {reduction.size: 3}}]"
    (line,) = refuse(*words, "-o", tmp_path / "x.h5", "--set", settings)
    assert line.startswith("sweep setting 'tiny': reduction.size = 3: ")


def test_a_flight_that_trains_cannot_judge(refuse, words, sweep_flight, tmp_path):
    (line,) = refuse(*words, "-o", tmp_path / "x.h5", "--validate", sweep_flight)
    assert "is the training flight" in line


MISFIT = ("--set", "identification.subpopulations=5")


def test_a_setting_that_does_not_fit_stops_only_what_sweeps(cpfls, refuse, words, sweep, sweep_flight, tmp_path):
    said = f"{sweep}: sweep.set: identification.population = 8: 8 individuals cannot fill 5 subpopulations"
    assert refuse(*words, "-o", tmp_path / "x.h5", *MISFIT)[0].startswith(said)
    assert refuse("config", sweep, *MISFIT)[0].startswith(said)
    model, selection = tmp_path / "model.h5", tmp_path / "selection.h5"
    for command in (
        ("trajectory", sweep, "-o", tmp_path / "trajectory.h5"),
        ("reduce", sweep, sweep_flight, "-o", selection),
        ("identify", sweep, sweep_flight, "--selection", selection, "-o", model),
        ("replay", sweep, model, sweep_flight, "--every", "50", "-o", tmp_path / "replay.h5"),
    ):
        cpfls.done(*command, *MISFIT)
