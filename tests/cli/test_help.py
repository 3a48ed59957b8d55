"""Help, version and usage."""

import subprocess
import sys

import pytest
import typer

from cpfls_cli import __version__
from cpfls_cli.cli.stages import app

COMMANDS = (
    "look",
    "trajectory",
    "simulate",
    "init",
    "import",
    "reduce",
    "identify",
    "vehicle",
    "replay",
    "response",
    "tune",
    "export",
    "spread",
    "report",
    "compare",
    "diagnose",
    "extend",
    "gap",
    "changed",
    "trend",
    "info",
    "check",
    "config",
    "effects",
)
COMMON = ("--json", "--set", "--seed", "--force", "--quiet", "-q", "--verbose", "-v", "--dry-run", "--help", "-h")


def test_commands_are_those_documented():
    assert set(typer.main.get_command(app).commands) == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_lists_the_common_options(cpfls, command):
    result = cpfls(command, "--help")
    assert result.exit_code == 0
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
    assert result.exit_code == 2
    assert result.stdout == ""
    assert message in result.stderr
