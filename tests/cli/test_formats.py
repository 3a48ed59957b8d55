"""Formats, benchmarks and examples are as the docs have them."""

import runpy
from importlib import import_module
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from cpfls_cli.artifacts.gate import SCHEMA_VERSION
from cpfls_cli.result import datasets
from cpfls_cli.stages.info import formats

PAGE = (Path(__file__).parents[2] / "docs" / "format.md").read_text()
EXAMPLES = Path(__file__).parents[2] / "examples"


def test_page_names_the_schema_version_and_every_root_attribute():
    assert f"| `schema_version` | version of this page; {SCHEMA_VERSION} |" in PAGE
    assert all(f"| `{name}` |" in PAGE for name in ("format", "stage", "cpfls_version", "seed", "cautions"))


@pytest.mark.parametrize("stage", formats(), ids=lambda stage: stage.name)
def test_every_dataset_is_described(stage):
    held = dict(datasets(stage.kind))
    assert {"config", "inputs"}.isdisjoint(path.split("/")[0] for path in held)
    for each in held.values():
        assert each.about.unit
        assert each.about.frame
        assert each.about.text
        assert "|" not in each.about.text


def described(cpfls, *arguments):
    return cpfls.summary("info", *arguments)["formats"]


def test_one_format_is_described_without_a_file(cpfls):
    (flight,) = described(cpfls, "--format", "flight")
    assert (flight["format"], flight["commands"]) == ("cpfls/flight", ["simulate", "import"])
    torque = flight["datasets"]["body_torque"]
    assert (torque["dimensions"], torque["units"], torque["frame"]) == (["time", "axis"], "N m", "body (FLU)")
    lines = cpfls("info", "--format", "cpfls/flight").stdout
    assert all(path in lines for path in flight["datasets"])


def test_results_of_stages_are_described_too(cpfls):
    [look] = described(cpfls, "--format", "look")
    assert look["datasets"]["events/severity"]["dimensions"] == ["events"]
    assert look["datasets"]["balance/blocks"]["required"] is False


def test_without_a_name_all_are_listed(cpfls):
    assert {"cpfls/flight", "cpfls/look"} <= {each["format"] for each in described(cpfls)}
    assert "cpfls info --format changed" in cpfls("info").stdout


def test_a_wrong_name_lists_those_that_there_are(cpfls):
    result = cpfls("info", "--format", "flihgt")
    assert result.exit_code == 2
    assert "no such format (did you mean flight or flight-numbers?); there are changed," in result.stderr
    assert "leave out FILE or --format" in cpfls("info", "flight.h5", "--format", "flight").stderr


BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
OF_THE_EXTRA = {"jax", "rotorpy"}
WITHOUT_OPTIONS = {"__init__", "comparison"}
NAMES = sorted(path.stem for path in BENCHMARKS.glob("*.py") if path.stem not in WITHOUT_OPTIONS)


@pytest.mark.parametrize("name", [*NAMES, "paper.report"])
def test_every_benchmark_starts(name):
    try:
        module = import_module(f"benchmarks.{name}")
    except ModuleNotFoundError as missing:
        if missing.name not in OF_THE_EXTRA:
            raise
        pytest.skip(f"{missing.name} comes with the extra simulators")
    app = typer.Typer()
    app.command()(module.main)
    assert CliRunner().invoke(app, ["--help"]).exit_code == 0


def test_control_with_a_model_follows_closer_than_feedback_alone(cpfls, study, pipeline, tmp_path, capsys):
    path = cpfls.made("trajectory", study, "--set", "trajectory.sample_time_s=0.05", at=tmp_path / "path.h5")
    runpy.run_path(str(EXAMPLES / "computed_torque.py"))["main"](study, path, pipeline.model)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    errors = {name: [float(size) for size in sizes] for name, *sizes in lines}
    assert all(own < other for own, other in zip(errors["model"], errors["feedback"], strict=True))
