"""The command line of a stage is read from its source: as its function has it, and without its numerics."""

import inspect
import json
import subprocess
import sys
from typing import get_args

import pytest

from cpfls_cli.cli.stages import PARTS, STAGES, command_line
from cpfls_cli.stage import loaded

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
