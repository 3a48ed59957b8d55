"""When a search may go on, start again, or replace what lies there."""

import shutil

import h5py
import pytest

from tests.builders.command_line import act_at_evaluation, interrupt_this_process


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
    interrupt_at(3)
    assert cpfls(*words, "-o", stopped, "--force").exit_code == 130
    with h5py.File(f"{stopped}.checkpoint") as checkpoint:
        assert checkpoint["generation"][()] == -1


def test_search_that_is_refused_keeps_the_checkpoint(refuse, words, stopped, tmp_path):
    refuse(*words, "-o", stopped, "--force", "--validate", tmp_path / "none.h5")
    refuse(*words, "-o", stopped, "--resume", "--validate", tmp_path / "none.h5")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--seed", 2), "seed = 1 there, 2 here"),
        (("--set", "identification.population=18"), "identification.population = 16 there, 18 here"),
        (("--set", "identification.generations=0"), "identification.generations = 0, but it has reached generation"),
    ],
)
def test_other_config(refuse, words, stopped, options, said):
    (line,) = refuse(*words, "-o", stopped, "--resume", *options)
    assert line.startswith(f"{stopped}.checkpoint: belongs to another search: {said}")


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
    more = ("--set", "identification.generations=8")
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
    (line,) = refuse(*words, "-o", tmp_path / "model.h5", *option)
    assert line == (
        f"{notes}: has the name of what a stopped search leaves, but is none; move it away, or name another output"
    )
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
    several = ("--workers", 2, "--scheduler", "tcp://127.0.0.1:1")
    (line,) = refuse(*words, "-o", tmp_path / "model.h5", *several)
    assert line == "--scheduler: brings its own workers; leave out --workers"
