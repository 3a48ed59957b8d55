"""Help, version, usage, the cheat sheet, and command lines as the source has them."""

import inspect
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest
import typer

from cpfls_cli import __version__
from cpfls_cli.cli.options import sheet
from cpfls_cli.cli.stages import PARTS, STAGES, app, command_line
from cpfls_cli.stage import loaded

COMMANDS = typer.main.get_command(app).commands
COMMON = ("--json", "--set", "--seed", "--force", "--quiet", "-q", "--verbose", "-v", "--dry-run", "--help", "-h")
ROOT = Path(__file__).parents[2]
LISTED = [line.strip() for line in sheet().splitlines() if line.startswith("  ")]


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_lists_the_common_options(cpfls, command):
    result = cpfls.done(command, "--help")
    # What overrides a config is offered where one is read, and a seed where something is drawn.
    overriding = {"--set", "--seed"} if "CONFIG" not in result.stdout else set()
    overriding -= {"--seed"} if command == "spread" else set()
    assert all((option in result.stdout) == (option not in overriding) for option in COMMON)
    assert ("--output" in result.stdout) == (command not in {"info", "check", "config", "effects"})


def test_version_loads_nothing_heavy():
    code = (
        "import sys\n"
        "from cpfls_cli.cli.main import run\n"
        "sys.argv = ['cpfls', '--version']\n"
        "try:\n    run()\nexcept SystemExit as end:\n    assert not end.code\n"
        "print(*sorted(sys.modules))\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    version, modules = result.stdout.splitlines()
    assert version == f"cpfls {__version__}"
    heavy = {"numpy", "scipy", "h5py", "matplotlib", "pydantic", "yaml", "jinja2", "rich"}
    assert heavy.isdisjoint(modules.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["trajectry"], "No such command 'trajectry'"),
        (["trajectory", "a.yaml"], "Missing option '--output'"),
        (["trajectory", "a.yaml", "-o", "b.h5", "--seed", "-1"], "Invalid value for '--seed': '-1': input should be"),
        (["trajectory", "a.yaml", "-o", "b.h5", "--frobnicate"], "No such option: --frobnicate"),
        (["simulate", "a.yaml", "-o", "b.h5"], "Missing argument"),
    ],
)
def test_wrong_usage(cpfls, words, message):
    result = cpfls(*words)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr


def test_the_help_begins_with_it_on_one_screen(cpfls):
    said = cpfls("--help").stdout
    lines = sheet("  ").splitlines()
    assert "\n".join(lines) in said
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert said.index(lines[-1]) < said.index("Options:")
    # Wider terminals keep its lines.
    assert "\n".join(lines) in cpfls("-h").stdout


def test_readme_begins_with_it():
    page = (ROOT / "README.md").read_text()
    assert sheet("    ") in page
    assert page.index(sheet("    ")) < page.index("## Install")


@pytest.mark.parametrize("command", LISTED)
def test_each_command_is_taken_as_it_stands(command):
    program, name, *words = shlex.split(command)
    if program == "make":
        assert re.search(rf"^{name}:", (ROOT / "Makefile").read_text(), re.M)
        return
    assert program == "cpfls"
    group = typer.main.get_command(app)
    # A shell writes the files that a pattern stands for.
    words = [own for word in words for own in (["logs/a.csv", "logs/b.csv"] if word == "logs/*" else [word])]
    with group.commands[name].make_context(name, list(words)) as context:
        assert context.params["output"] == Path(words[words.index("-o") + 1])


FILES = [file for file in sorted(STAGES.glob("[a-z]*.py")) if file.stem not in PARTS]
LOADS = """
import json, sys
from pathlib import Path
import cpfls_cli.cli.stages
from cpfls_cli.cli.stages import command_line
print(json.dumps({name: sorted({module.partition(".")[0] for module in set(sys.modules)})
    for name in json.loads(sys.argv[1]) if command_line(Path(name))}))
"""


def described(parameter):
    """All that a parameter says: its options are objects, which the library compares by identity."""
    kind, *options = get_args(parameter.annotation)
    said = [{key: value for key, value in vars(own).items() if not callable(value)} for own in options]
    return parameter.name, str(kind), str(parameter.default), said


@pytest.mark.parametrize("file", FILES, ids=[file.stem for file in FILES])
def test_it_is_that_of_the_function(file):
    read, own = command_line(file), loaded(file.stem)
    parameters = inspect.signature(own.function, eval_str=True).parameters.values()
    assert list(map(described, read.parameters)) == [described(each) for each in parameters if each.name != "run"]
    flags = (bool(own.study), own.folder, own.fills is not None, own.several)
    assert (read.study, read.folder, read.fills, read.several) == flags
    assert (read.output is None) == (own.output is None)


def test_it_loads_nothing_heavy():
    words = [sys.executable, "-c", LOADS, json.dumps([str(file) for file in FILES])]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    heavy = {"h5py", "jinja2", "matplotlib", "numba", "numpy", "scipy", "yaml"}
    assert {
        name: heavy & set(modules) for name, modules in json.loads(done.stdout).items() if heavy & set(modules)
    } == {}
