"""The map names every room of the package, in the order of the import contract, and only modules that exist."""

import ast
import re
import tomllib
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from tests.builders.sources import nodes, syntax

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "cpfls_cli"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROOMS = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
MODULES = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}


def test_every_room_has_its_row():
    rows = re.findall(r"^\| (`[^|]+`) \|", PAGE, flags=re.MULTILINE)
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(named) == sorted(ROOMS | MODULES)


def test_the_picture_is_the_import_contract():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["name"] == "Imports go down only")
    picture = re.findall(r"^    ([a-z]\w*(?: \| \w+)*)(?:  |$)", PAGE, flags=re.MULTILINE)
    assert [set(line.split(" | ")) for line in picture] == [
        set(layer.replace(" : ", " | ").split(" | ")) for layer in layers
    ]


def test_every_module_that_it_names_exists():
    named = set(re.findall(r"`(\w+(?:/\w+)*\.py)`", PAGE))
    assert len(named) > 30
    assert [name for name in sorted(named) if not (PACKAGE / name).exists() and not (ROOT / name).exists()] == []


def own_imports_in_functions(path):
    """Modules of the package that functions of a module import, wherever in them the import stands."""
    for function in (node for node in nodes(path) if isinstance(node, ast.FunctionDef)):
        for node in ast.walk(function):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cpfls_cli"):
                yield f"{path.relative_to(PACKAGE)}: {function.name}: {node.module}"


def has(module, name):
    """Whether a module has a name, or a package a module of that name."""
    own = import_module(module)
    return hasattr(own, name) or (hasattr(own, "__path__") and find_spec(f"{module}.{name}") is not None)


def test_what_is_outside_of_the_package_takes_only_names_that_it_has():
    """Benchmarks and examples are run by hand."""
    files = [file for folder in ("benchmarks", "docs", "examples") for file in sorted((ROOT / folder).rglob("*.py"))]
    taken = [
        (file.relative_to(ROOT).as_posix(), node.module, own.name)
        for file in files
        for node in nodes(file)
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "cpfls_cli"
        for own in node.names
    ]
    assert len(taken) > 100
    assert [each for each in taken if not has(*each[1:])] == []


# These load what they are asked for: a command, what an object of the Python interface does, Dask, what is drawn.
BY_NEED = {"cli", "library", "workers/workforce.py", "report/canvas.py"}


def test_layers_hold_as_imported():
    """What a module needs it imports where the import contracts see it; `artifacts/gate.py` loads by need."""
    names = {path.relative_to(PACKAGE).as_posix(): path for path in sorted(PACKAGE.rglob("*.py"))}
    modules = [path for name, path in names.items() if {name, name.split("/")[0]}.isdisjoint(BY_NEED)]
    assert [entry for path in modules for entry in own_imports_in_functions(path)] == []


def test_a_front_page_that_nobody_outside_needs_loads_nothing():
    needed = {"__init__.py", "fuzzy/__init__.py", "library/__init__.py"}
    pages = {page.relative_to(PACKAGE).as_posix(): page for page in PACKAGE.rglob("__init__.py")}
    assert {name for name, page in pages.items() if len(syntax(page).body) > 1} == needed
