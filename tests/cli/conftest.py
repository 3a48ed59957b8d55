"""The command line as a function, and a tiny study taken through every stage once."""

import json
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.builders import command_line
from tests.builders.studies import LOG_STUDY, TINY, VEHICLE, put_file, stages


@pytest.fixture(scope="session")
def cpfls():
    """Run a command; anything but an exit is a bug and is raised."""
    return command_line.run


@pytest.fixture
def refuse(cpfls, tmp_path):
    """Run a command that must fail, leave every file as it was, and say why; give its messages."""

    def contents():
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    def call(*words, code=2):
        before = contents()
        result = cpfls(*words)
        assert result.exit_code == code, result.output
        assert result.stdout == ""
        assert contents() == before
        lines = result.stderr.splitlines()
        assert lines
        assert all(line.startswith("cpfls: error: ") for line in lines), result.stderr
        assert "Traceback" not in result.stderr
        return [line.removeprefix("cpfls: error: ") for line in lines]

    return call


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    return put_file(tmp_path_factory.mktemp("study") / "tiny.yaml", TINY + VEHICLE)


@pytest.fixture(scope="session")
def pipeline(cpfls, study):
    """Every artifact of the tiny study, and what the commands printed with --json."""
    paths, commands = stages(study, study.parent)
    printed = {}
    for stage, words in commands.items():
        printed[stage] = cpfls.done(*words, "-o", paths[stage], "--json").stdout
    return SimpleNamespace(
        **paths, paths=paths, printed=printed, summaries={k: json.loads(v) for k, v in printed.items()}
    )


@pytest.fixture
def log_study(tmp_path):
    """A study that imports logs of attitude and torque."""
    return put_file(tmp_path / "study.yaml", LOG_STUDY + VEHICLE)


@pytest.fixture(scope="session")
def configs():
    """The configs that are shipped."""
    found = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
    assert found
    return found


@pytest.fixture
def at_evaluation(monkeypatch):
    """Do something when so many chromosomes are evaluated, over all searches of a command."""

    return partial(command_line.act_at_evaluation, monkeypatch)


@pytest.fixture
def interrupt_at(at_evaluation):
    """Send this very process an interrupt when so many chromosomes are evaluated."""
    return lambda number: at_evaluation(number, command_line.interrupt_this_process)
