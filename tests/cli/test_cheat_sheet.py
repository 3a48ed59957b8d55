"""The cheat sheet: the same in the help and in README.md, short, and each command one that there is."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from cpfls_cli.cli.options import WORKFLOWS, sheet
from cpfls_cli.cli.stages import app

ROOT = Path(__file__).parents[2]
COMMANDS = [command for _, commands in WORKFLOWS for command in commands]


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


@pytest.mark.parametrize("command", COMMANDS)
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
