"""A search that is interrupted goes on to the same end, and what cannot go on is refused."""

import json
import shutil
import signal

import h5py
import numpy as np
import pytest

from cpfls_cli import load_model
from cpfls_cli.arguments import seconds
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.store import read
from tests.builders.command_line import act_at_evaluation, interrupt_this_process

NOTE = "cpfls: note: "


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def stored(path, name):
    with h5py.File(path) as file:
        return file[name][()]


def test_search_that_comes_to_its_end_says_so(whole):
    assert stored(whole, "stop_reason") == b"generations"


def test_interrupted_search_keeps_a_model_and_goes_on_to_the_same_end(
    cpfls, words, whole, tmp_path, interrupt_at, monkeypatch
):
    output = tmp_path / "model.h5"
    interrupt_at(33)
    result = cpfls(*words, "-o", output, "--json")
    assert result.exit_code == 130
    assert names(tmp_path) == ["model.h5", "model.h5.checkpoint"]
    summary = json.loads(result.stdout)
    assert (summary["stop_reason"], summary["complete"]) == ("interrupted", False)
    assert summary["evaluations"] == 33 == stored(output, "history/evaluations")[-1]
    assert result.stderr.splitlines()[-1] == (
        f"{NOTE}{output}: is incomplete, because the search was interrupted; the same command with --resume goes on"
    )
    assert read(output, IdentifiedModel)[0].stopped == "interrupted"
    monkeypatch.undo()
    cpfls.done(*words, "-o", output, "--resume")
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["model.h5"]


def test_incomplete_model_predicts(pipeline, stopped):
    with pytest.warns(UserWarning, match="has no verdict"):
        assert np.isfinite(load_model(stopped).predict(pipeline.flight).torque).all()


def test_interrupted_again_and_again_it_evaluates_nothing_twice(cpfls, words, whole, tmp_path, interrupt_at):
    output, option, runs = tmp_path / "model.h5", (), []
    while not runs or runs[-1].exit_code == 130:
        # The first run does not even finish the initial population.
        interrupt_at(15)
        runs.append(cpfls(*words, "-o", output, *option))
        option = ("--resume",)
        assert stored(output, "history/evaluations")[-1] == min(
            15 * len(runs), stored(whole, "history/evaluations")[-1]
        )
    assert runs[-1].exit_code == 0
    assert output.read_bytes() == whole.read_bytes()
    assert names(tmp_path) == ["model.h5"]


def test_interrupted_in_the_last_evaluation_it_is_judged_when_it_goes_on(cpfls, words, whole, tmp_path, interrupt_at):
    interrupt_at(int(stored(whole, "history/evaluations")[-1]))
    result = cpfls(*words, "-o", tmp_path / "model.h5")
    assert result.exit_code == 130
    assert f"{tmp_path / 'model.h5'}: was found but not judged, because of the interrupt" in result.stderr
    assert names(tmp_path) == ["model.h5", "model.h5.checkpoint"]
    cpfls.done(*words, "-o", tmp_path / "model.h5", "--resume")
    assert names(tmp_path) == ["model.h5"]
    assert (tmp_path / "model.h5").read_bytes() == whole.read_bytes()


@pytest.fixture
def nothing_found(monkeypatch):
    """Every chromosome fails."""
    monkeypatch.setattr(
        "cpfls_cli.identification.evaluator.Evaluator.__call__",
        lambda _, genes: Evaluation(genes, np.full((len(genes), 3), np.inf)),
    )


@pytest.mark.usefixtures("nothing_found")
def test_interrupted_without_a_finite_model(cpfls, words, tmp_path, interrupt_at):
    interrupt_at(20)
    result = cpfls(*words, "-o", tmp_path / "model.h5")
    assert (result.exit_code, result.stdout) == (130, "")
    assert names(tmp_path) == ["model.h5.checkpoint"]
    assert result.stderr == (
        "cpfls: error: the search was interrupted before a model was found, so none is written; "
        "the same command with --resume goes on\n"
    )


@pytest.mark.usefixtures("nothing_found")
def test_search_that_found_nothing_at_its_end_leaves_nothing(cpfls, words, pipeline, tmp_path):
    result = cpfls(*words, "-o", tmp_path / "model.h5")
    assert result.exit_code == 1
    assert result.stderr == (
        f"cpfls: error: {pipeline.flight}: no chromosome gave a finite model; perhaps nothing moves in the data\n"
    )
    assert names(tmp_path) == []


def test_search_out_of_time_keeps_a_model_and_goes_on(cpfls, words, whole, tmp_path, at_evaluation, monkeypatch):
    output = tmp_path / "model.h5"
    clock = [100.0]
    monkeypatch.setattr("cpfls_cli.search.time.monotonic", lambda: clock[0])
    at_evaluation(40, lambda: clock.__setitem__(0, 700.0))
    result = cpfls.done(*words, "-o", output, "--time-limit", "10m")
    assert (stored(output, "stop_reason"), stored(output, "history/evaluations")[-1]) == (b"time-limit", 40)
    assert result.stderr.splitlines()[-1] == (
        f"{NOTE}{output}: is incomplete, because --time-limit ended the search; the same command with --resume goes on"
    )
    monkeypatch.undo()
    go_on = "its search was stopped (time limit), go on with `cpfls identify ... --resume`"
    assert cpfls("check", output).stdout.startswith(f"{output}: keeps to its format (cpfls/identified), but {go_on}\n")
    assert go_on.removeprefix("its search was ") in cpfls("info", output).stdout
    cpfls.done(*words, "-o", output, "--resume", "--time-limit", "2h")
    assert cpfls("check", output).stdout.startswith(f"{output}: good (cpfls/identified)\n")
    assert output.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize(
    ("text", "limit"), [("90", 90.0), ("90s", 90.0), ("1.5m", 90.0), ("2h", 7200.0), ("1e3", 1000.0)]
)
def test_time_limit_in_several_units(text, limit):
    assert seconds(text) == limit


@pytest.mark.parametrize("text", ["0", "-3s", "soon", "", "10 days", "nan", "inf", "h"])
def test_time_limit_that_is_none(cpfls, words, tmp_path, text):
    result = cpfls(*words, "-o", tmp_path / "model.h5", f"--time-limit={text}")
    assert result.exit_code == 2
    assert "--time-limit" in result.stderr
    assert "10m" in result.stderr
    assert names(tmp_path) == []


def test_stalled_search_ends_converged(cpfls, words, ended, tmp_path):
    stall = ("--set", "identification.stall_generations=1", "--set", "identification.stall_improvement=0.9")
    summary = cpfls.summary(*words, "-o", tmp_path / "model.h5", *stall)
    assert (summary["stop_reason"], summary["complete"], summary["generations"] < 6) == ("converged", True, True)
    assert names(tmp_path) == ["model.h5"]
    assert (
        f"converged after generation {summary['generations']}: no objective improved enough "
        "(identification.stall_generations = 1)"
    ) in cpfls(*words, "-o", tmp_path / "told.h5", *stall, "-v").stdout.splitlines()
    assert "converged" not in ended[1]


@pytest.fixture(scope="module")
def stopped_once(cpfls, words, tmp_path_factory):
    """The folder of an incomplete model with its checkpoint; nobody writes into it."""
    folder = tmp_path_factory.mktemp("stopped")
    with pytest.MonkeyPatch.context() as monkeypatch:
        act_at_evaluation(monkeypatch, 33, interrupt_this_process)
        assert cpfls(*words, "-o", folder / "model.h5").exit_code == 130
    return folder


@pytest.fixture
def stopped(stopped_once, tmp_path):
    """An incomplete model with its checkpoint."""
    shutil.copytree(stopped_once, tmp_path, dirs_exist_ok=True)
    return tmp_path / "model.h5"


def test_nothing_to_resume(refuse, words, tmp_path):
    (line,) = refuse(*words, "-o", tmp_path / "model.h5", "--resume")
    assert line == f"{tmp_path / 'model.h5'}.checkpoint: no such file, so nothing to resume; start without --resume"


def test_finished_search_has_nothing_to_resume(refuse, words, whole, stopped):
    checkpoint, incomplete = stopped.with_name("model.h5.checkpoint"), stopped.read_bytes()
    checkpoint.unlink()
    (line,) = refuse(*words, "-o", stopped, "--resume")
    assert line.startswith(f"{checkpoint}: no such file")
    assert incomplete != whole.read_bytes()
    assert refuse(*words, "-o", whole, "--resume") == [f"{whole}: is complete; nothing to resume"]


@pytest.mark.parametrize("option", [(), ("--dry-run",)])
def test_checkpoint_of_which_nothing_is_said(refuse, words, stopped, option):
    expected = (
        f"{stopped}.checkpoint: a search for {stopped} was stopped here; --resume continues it, --force starts again"
    )
    assert refuse(*words, "-o", stopped, *option) == [expected]
    stopped.unlink()
    assert refuse(*words, "-o", stopped, *option) == [expected]


@pytest.mark.parametrize("option", ["--resume", "--force"])
def test_dry_run_changes_nothing(cpfls, words, stopped, option):
    before = {path: path.read_bytes() for path in stopped.parent.iterdir()}
    cpfls.done(*words, "-o", stopped, option, "--dry-run")
    assert {path: path.read_bytes() for path in stopped.parent.iterdir()} == before


def test_force_starts_again(cpfls, words, stopped, whole):
    cpfls.done(*words, "-o", stopped, "--force")
    assert stopped.read_bytes() == whole.read_bytes()
    assert [path.name for path in stopped.parent.iterdir()] == ["model.h5"]


def test_forced_search_gives_up_the_checkpoint_from_the_start(cpfls, words, stopped, interrupt_at):
    """And leaves the handlers of signals as they were."""
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    interrupt_at(3)
    assert cpfls(*words, "-o", stopped, "--force").exit_code == 130
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    with h5py.File(f"{stopped}.checkpoint") as checkpoint:
        assert checkpoint["generation"][()] == -1


def test_search_that_is_refused_keeps_the_checkpoint(refuse, words, stopped, tmp_path):
    refuse(*words, "-o", stopped, "--force", "--validate", tmp_path / "none.h5")
    refuse(*words, "-o", stopped, "--resume", "--validate", tmp_path / "none.h5")


def test_other_selection_and_other_flight(cpfls, refuse, search, pipeline, stopped, tmp_path):
    (line,) = refuse("identify", search, pipeline.flight, "-o", stopped, "--resume")
    assert "selection = selection.h5 (" in line
    assert "none here" in line
    other = tmp_path / "other.h5"
    noise = ("--set", "simulation.relative_noise={torque: 0.05}")
    cpfls.done("simulate", search, pipeline.trajectory, "-o", other, *noise)
    (line,) = refuse("identify", search, other, "-o", stopped, "--resume")
    assert "flight = flight.h5 (" in line
    assert "other.h5 (" in line


def test_more_generations(cpfls, words, stopped, tmp_path):
    more = ("--set", "identification.generations=7")
    cpfls.done(*words, "-o", stopped, "--resume", *more)
    cpfls.done(*words, "-o", tmp_path / "straight.h5", *more)
    assert stopped.read_bytes() == (tmp_path / "straight.h5").read_bytes()


def test_damaged_checkpoint(refuse, words, stopped):
    checkpoint = stopped.with_name("model.h5.checkpoint")
    content = bytearray(checkpoint.read_bytes())
    checkpoint.write_bytes(content[: len(content) // 2])
    (line,) = refuse(*words, "-o", stopped, "--resume")
    assert line.startswith(f"{checkpoint}: ")
    assert line.endswith("--force without --resume starts again")


@pytest.mark.parametrize("folder", [False, True])
@pytest.mark.parametrize("option", [(), ("--force",)])
def test_a_file_of_the_user_with_the_name_of_the_checkpoint_is_kept(refuse, words, tmp_path, option, folder):
    notes = tmp_path / "model.h5.checkpoint"
    notes.mkdir() if folder else notes.write_text("my notes\n")
    assert refuse(*words, "-o", tmp_path / "model.h5", *option) == [
        f"{notes}: has the name of what a stopped search leaves, but is none; move it away, or name another output"
    ]
    assert notes.is_dir() if folder else notes.read_text() == "my notes\n"


def test_other_file_in_the_place_of_the_output_is_not_replaced(refuse, words, stopped, pipeline):
    for content in (b"precious", pipeline.model.read_bytes()):
        stopped.write_bytes(content)
        assert refuse(*words, "-o", stopped, "--resume") == [f"{stopped}: exists already; --force replaces it"]


def test_killed_between_the_model_and_the_removal_of_its_checkpoint(cpfls, words, stopped, whole):
    stopped.write_bytes(whole.read_bytes())
    cpfls.done(*words, "-o", stopped, "--resume")
    assert stopped.read_bytes() == whole.read_bytes()
    assert [path.name for path in stopped.parent.iterdir()] == ["model.h5"]


def test_workers_and_scheduler_exclude_each_other(refuse, words, tmp_path):
    (line,) = refuse(*words, "-o", tmp_path / "model.h5", "--workers", 2, "--scheduler", "tcp://127.0.0.1:1")
    assert line == "--scheduler: brings its own workers; leave out --workers"
