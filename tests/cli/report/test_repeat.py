"""The commands that a report prints make its artifacts again, byte for byte."""

import json
import shlex
import shutil

import pytest

from cpfls_cli.artifacts.store import file_sha256

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture
def printed(cpfls, study, tmp_path):
    """Write a report, and give its commands and its configs by their names."""

    def call(*artifacts):
        output = tmp_path / "report.json"
        result = cpfls("report", study, *artifacts, "-o", output, "--force")
        assert result.exit_code == 0, result.stderr
        page = json.loads(output.read_text(encoding="utf-8"))
        blocks = next(section["blocks"] for section in page["sections"] if section["name"] == "provenance")
        lists = [block for block in blocks if block["kind"] == "listing"]
        commands = next(block["text"] for block in lists if block["summary"] == "Commands to repeat").splitlines()
        return commands, {
            block["summary"].split(":")[0]: block["text"] for block in lists if ": config of" in block["summary"]
        }

    return call


def repeat(cpfls, commands, configs, folder, monkeypatch):
    folder.mkdir()
    monkeypatch.chdir(folder)
    for name, text in configs.items():
        (folder / name).write_text(text, encoding="utf-8")
    for line in commands:
        words = shlex.split(line, comments=True)
        if words[:2] == ["mkdir", "-p"]:
            (folder / words[2]).mkdir()
        elif words:
            result = cpfls(*words[1:])
            assert result.exit_code == 0, result.stderr
    return {path.relative_to(folder).as_posix(): file_sha256(path) for path in folder.rglob("*.h5")}


def test_the_printed_commands_make_every_artifact_again(cpfls, pipeline, printed, tmp_path, monkeypatch):
    paths = pipeline.paths.values()
    commands, configs = printed(*reversed(paths))
    made = repeat(cpfls, commands, configs, tmp_path / "again", monkeypatch)
    assert made == {path.name: file_sha256(path) for path in paths}


def test_overrides_and_seeds_are_in_the_config_and_equal_names_in_folders(
    cpfls, pipeline, study, printed, tmp_path, monkeypatch
):
    other = tmp_path / "other"
    other.mkdir()
    flight = other / "flight.h5"
    noisy = ("--set", "simulation.relative_noise.torque=0.05", "--seed", "7")
    assert cpfls("simulate", study, pipeline.trajectory, "-o", flight, *noisy).exit_code == 0
    commands, configs = printed(pipeline.trajectory, pipeline.flight, flight)
    assert len(configs) == 2
    made = repeat(cpfls, commands, configs, tmp_path / "again", monkeypatch)
    assert {name: sha256 for name, sha256 in made.items() if name.endswith("flight.h5")} == {
        f"{file_sha256(path)[:12]}/flight.h5": file_sha256(path) for path in (pipeline.flight, flight)
    }


def test_what_is_not_in_the_report_is_named_with_its_hash(pipeline, printed, tmp_path):
    renamed = tmp_path / "renamed; rm.h5"
    shutil.copy(pipeline.model, renamed)
    commands, _ = printed(renamed)
    assert f"# needs flight.h5, sha256 {file_sha256(pipeline.flight)}" in commands
    assert commands[-1].startswith("cpfls identify study-")
    assert commands[-1].endswith("flight.h5 --selection selection.h5 -o 'renamed; rm.h5'")
