"""What is loaded: nothing heavy for the version, and no plotting for what is printed."""

import json
import subprocess
import sys
from pkgutil import iter_modules

from cpfls_cli import commands, pages

HEAVY = {"h5py", "jinja2", "matplotlib", "numba", "numpy", "pydantic", "scipy", "yaml"}
CODE = """
import json, sys
from typer.testing import CliRunner
from cpfls_cli.cli.app import app
commands = json.loads(sys.argv[1])
for words in commands:
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
print(json.dumps(sorted(sys.modules)))
"""


def modules(*commands):
    """Run commands in a process of their own; give all modules that it has loaded in the end."""
    words = json.dumps([[str(word) for word in command] for command in commands])
    result = subprocess.run([sys.executable, "-c", CODE, words], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout.splitlines()[-1])


def loaded(*commands):
    """Give the heavy packages that commands load."""
    return sorted(HEAVY & set(modules(*commands)))


def of_gap(names):
    """Pick the modules of the gap but its settings, which the config holds as those of all rooms."""
    return [name for name in names if name.startswith("cpfls_cli.gap.") and name != "cpfls_cli.gap.settings"]


def of_trust(name):
    """Tell whether a module holds the words of trust, or is the front page of the room that they are in."""
    rooms = {"cpfls_cli.validation", "cpfls_cli.pages"}
    return name in rooms or name in {f"{room}.trust" for room in rooms}


def test_the_version_and_the_help_load_nothing_heavy():
    assert loaded(("--version",), ("--help",)) == []


def test_the_python_interface_loads_nothing_heavy_before_it_is_used():
    code = f"import sys, cpfls_cli; print(sorted({HEAVY | {'typer', 'rich'}} & set(sys.modules)))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "[]\n"


def test_what_only_reads_loads_neither_compiled_loops_nor_scipy(pipeline, study):
    commands = ("info", pipeline.model), ("check", pipeline.model), ("check", pipeline.flight), ("config", study)
    assert loaded(*commands, ("config",)) == ["h5py", "numpy", "pydantic", "yaml"]


def test_what_is_printed_loads_no_plotting(pipeline, study, tmp_path):
    short = "trajectory={legs: 1, displacement_m: 1.0, period_s: 0.18, duration_s: 3.0, yaw_turn_rad: 0.3}"
    packages = loaded(
        ("trajectory", study, "--set", short, "-o", tmp_path / "trajectory.h5"),
        ("simulate", study, pipeline.trajectory, "-o", tmp_path / "flight.h5"),
        ("simulate", study, tmp_path / "trajectory.h5", "--mode", "closed-loop", "-o", tmp_path / "closed.h5"),
        ("reduce", study, pipeline.flight, "-o", tmp_path / "selection.h5"),
        ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", tmp_path / "model.h5"),
        ("predict", study, pipeline.model, pipeline.flight, "-o", tmp_path / "prediction.h5"),
        ("export", pipeline.model, "-o", tmp_path / "model.json"),
        ("info", pipeline.model),
        ("check", pipeline.model),
        ("config", study),
        ("effects",),
    )
    assert "matplotlib" not in packages


def test_no_command_and_no_page_loads_plotting_before_it_draws():
    names = [module.name for room in (commands, pages) for module in iter_modules(room.__path__, f"{room.__name__}.")]
    assert len(names) > 20
    code = f"import sys, {', '.join(names)}; print('matplotlib' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "False\n"


def test_a_report_loads_neither_compiled_loops_nor_what_of_scipy_is_slow_to_load():
    slow = "{'numba', 'scipy.signal', 'scipy.stats'}"
    code = f"import sys, cpfls_cli.commands.report; print(sorted({slow} & set(sys.modules)))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "[]\n"


def test_a_search_loads_nothing_of_scipy_that_only_logs_need():
    """Splines and filters take a third of the start of a command, and no flight of `cpfls import` needs them again."""
    slow = "{'scipy.interpolate', 'scipy.optimize', 'scipy.signal', 'scipy.stats'}"
    code = f"import sys; from cpfls_cli.commands import identify, reduce, sweep; print({slow} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"


def test_commands_load_no_room_that_they_do_not_work_in(pipeline, study, tmp_path):
    reduced = modules(("reduce", study, pipeline.flight, "-o", tmp_path / "selection.h5"))
    assert of_gap(reduced) == []
    assert "cpfls_cli.playback.model" not in reduced
    assert of_gap(modules(("identify", study, pipeline.flight, "-o", tmp_path / "model.h5"))) == []


def test_what_a_file_holds_is_told_without_the_numerics_that_made_it(pipeline):
    shown = modules(("info", pipeline.flight), ("check", pipeline.selection), ("info", pipeline.model))
    # How far to trust a model is told in a word, and words of trust stand in a module of their own.
    rooms = {name.split(".")[1] for name in shown if name.startswith("cpfls_cli.") and not of_trust(name)}
    assert rooms.isdisjoint({"gap", "effects", "identification", "validation", "reduction", "weak_form", "pages"})
