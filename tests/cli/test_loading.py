"""What is loaded: nothing heavy for the version, and no plotting for what is printed."""

import json
import subprocess
import sys
from pkgutil import iter_modules

import pytest

from cpfls_cli import pages, stages

HEAVY = {"h5py", "jinja2", "matplotlib", "numba", "numpy", "pydantic", "scipy", "yaml"}
LOADS = """
import json, sys
for code in json.loads(sys.argv[1]):
    exec(code)
    print(json.dumps(sorted(sys.modules)))
"""
COMMAND = """
from typer.testing import CliRunner
from cpfls_cli.cli.stages import app
result = CliRunner().invoke(app, {words!r})
assert result.exit_code == 0, result.output
"""


def loading(codes):
    """Run pieces of code in a process of their own; give all modules that it has loaded after each."""
    result = subprocess.run([sys.executable, "-c", LOADS, json.dumps(codes)], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return [set(json.loads(line)) for line in result.stdout.splitlines()]


@pytest.fixture(scope="module")
def after(pipeline, study, tmp_path_factory):
    """Modules after each group of commands, one group after the other: what an earlier one loads a later one has."""
    folder = tmp_path_factory.mktemp("loading")
    trajectory, closed = folder / "trajectory.h5", folder / "closed.h5"
    short = "trajectory={legs: 1, displacement_m: 1.0, period_s: 0.18, duration_s: 3.0, yaw_turn_rad: 0.3}"
    groups = {
        "nothing": [("--version",), ("--help",)],
        "reading": [("check", pipeline.flight), ("config", study), ("config",)],
        "reduce": [("reduce", study, pipeline.flight, "-o", folder / "selection.h5")],
        "identify": [
            ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", folder / "model.h5")
        ],
        "all": [
            ("trajectory", study, "--set", short, "-o", trajectory),
            ("simulate", study, pipeline.trajectory, "-o", folder / "flight.h5"),
            ("simulate", study, trajectory, "--mode", "closed-loop", "-o", closed),
            ("replay", study, pipeline.model, pipeline.flight, "--every", "50", "-o", folder / "replay.h5"),
            ("export", pipeline.model, "-o", folder / "model.json"),
            ("effects",),
        ],
    }
    codes = ["".join(COMMAND.format(words=[str(word) for word in words]) for words in own) for own in groups.values()]
    return dict(zip(groups, loading(codes), strict=True))


def of_gap(names):
    """Pick the modules of the gap but its settings, which the config holds as those of all rooms."""
    return [name for name in names if name.startswith("cpfls_cli.gap.") and name != "cpfls_cli.gap.settings"]


def test_each_group_of_commands_loads_no_more_than_it_needs(after):
    assert HEAVY & after["nothing"] == set()
    assert HEAVY & after["reading"] == {"h5py", "jinja2", "numpy", "pydantic", "yaml"}
    assert {"matplotlib", "scipy.io"} & after["all"] == set()


@pytest.fixture(scope="module")
def imported():
    """Modules after imports, one after the other."""
    names = [module.name for room in (pages, stages) for module in iter_modules(room.__path__, f"{room.__name__}.")]
    assert len(names) > 20
    codes = {
        "the package": "import cpfls_cli",
        "flying": "from cpfls_cli.stages import simulate, trajectory",
        "searches": "from cpfls_cli.stages import identify, reduce",
        "report": "import cpfls_cli.stages.report",
        "all commands and pages": f"import {', '.join(names)}",
    }
    return dict(zip(codes, loading([*codes.values()]), strict=True))


def test_imports_load_no_more_than_is_worked_with(imported):
    assert (HEAVY | {"typer", "rich"}) & imported["the package"] == set()
    # It takes half the start of both, and only a model that is given needs it.
    models = {"cpfls_cli.artifacts.vehicle_model", "cpfls_cli.flights.models", "cpfls_cli.playback.model"}
    assert (models | {"scipy"}) & imported["flying"] == set()
    # Splines take a fifth of the start of a command, and no flight of `cpfls import` needs them again.
    assert {"scipy.interpolate", "scipy.optimize", "scipy.spatial"} & imported["searches"] == set()
    assert "numba" not in imported["report"]


def test_no_command_waits_for_what_of_scipy_is_slow_to_load_but_one_that_filters(after, imported):
    assert {"scipy.signal", "scipy.stats"} & (after["identify"] | imported["all commands and pages"]) == set()


def test_no_command_and_no_page_loads_plotting_before_it_draws(imported):
    assert "matplotlib" not in imported["all commands and pages"]


def test_commands_load_no_room_that_they_do_not_work_in(after):
    assert of_gap(after["reduce"]) == []
    assert "cpfls_cli.playback.model" not in after["reduce"]
    assert of_gap(after["identify"]) == []
