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


@pytest.mark.parametrize("suffix", ["partial", "checkpoint"])
def test_a_file_of_the_user_with_the_name_of_what_a_sweep_leaves_is_kept(refuse, words, tmp_path, suffix):
    notes = tmp_path / f"sweep.h5.{suffix}"
    notes.write_text("my notes\n")
    (line,) = refuse(*words, "-o", tmp_path / "sweep.h5", "--force")
    assert line.startswith(f"{notes}: has the name of what a stopped ")
    assert notes.read_text() == "my notes\n"


def test_finished_sweep_has_nothing_to_resume(refuse, words, whole):
    assert refuse(*words, "-o", whole, "--resume") == [f"{whole}: is complete; nothing to resume"]


def test_finished_runs_of_which_nothing_is_said(refuse, words, stopped):
    (line,) = refuse(*words, "-o", stopped)
    assert line == (
        f"{stopped}.partial: a sweep for {stopped} was stopped here; --resume continues it, --force starts again"
    )


def test_force_starts_again(cpfls, words, stopped, whole):
    assert cpfls(*words, "-o", stopped, "--force").exit_code == 0
    assert stopped.read_bytes() == whole.read_bytes()
    assert [path.name for path in stopped.parent.iterdir()] == ["sweep.h5"]


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


def test_other_flight(cpfls, refuse, sweep, sweep_flight, stopped, tmp_path):
    other = tmp_path / "other.h5"
    noise = ("--set", "simulation.relative_noise={torque: 0.05}")
    assert cpfls("simulate", sweep, sweep_flight.with_name("trajectory.h5"), "-o", other, *noise).exit_code == 0
    (line,) = refuse("sweep", sweep, other, "-o", stopped, "--resume")
    assert "flight = flight.h5 (" in line
    assert "other.h5 (" in line


def test_damaged_runs(refuse, words, stopped):
    partial = stopped.with_name("sweep.h5.partial")
    partial.write_bytes(partial.read_bytes()[:2000])
    (line,) = refuse(*words, "-o", stopped, "--resume")
    assert line.startswith(f"{partial}: ")
    assert line.endswith("--force without --resume starts again")


def test_other_file_in_the_place_of_the_output_is_not_replaced(refuse, words, stopped):
    stopped.write_bytes(b"precious")
    assert refuse(*words, "-o", stopped, "--resume") == [f"{stopped}: exists already; --force replaces it"]


def test_workers_and_scheduler_exclude_each_other(refuse, words, tmp_path):
    (line,) = refuse(*words, "-o", tmp_path / "x.h5", "--workers", 2, "--scheduler", "tcp://127.0.0.1:1")
    assert line == "--scheduler: brings its own workers; leave out --workers"


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
        ("predict", sweep, model, sweep_flight, "-o", tmp_path / "prediction.h5"),
    ):
        result = cpfls(*command, *MISFIT)
        assert result.exit_code == 0, result.stderr
