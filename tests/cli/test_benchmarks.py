"""The benchmarks find what they import and say what they are; what they print is published in the docs."""

from importlib import import_module
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

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
