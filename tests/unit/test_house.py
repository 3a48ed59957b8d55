"""The rules of the house that no linter knows: short functions, documented public names, quiet packages."""

import ast
from pathlib import Path
from statistics import median

import pytest

import cpfls_cli

PACKAGE = Path(cpfls_cli.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
LONGEST = 60


def functions(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


def body_lines(function):
    """Lines of code without the docstring: a full description of shapes and units must not cost length."""
    start = function.body[1] if ast.get_docstring(function) and len(function.body) > 1 else function.body[0]
    return function.end_lineno - start.lineno + 1


def test_functions_are_short():
    lengths = {f"{path}:{f.name}": body_lines(f) for path in MODULES for f in functions(path)}
    assert {name: length for name, length in lengths.items() if length > LONGEST} == {}
    assert median(lengths.values()) <= 10


def test_public_functions_say_what_they_take_and_return():
    missing = []
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                text = ast.get_docstring(node) or ""
                takes = [a.arg for a in node.args.args + node.args.kwonlyargs]
                if not text or (takes and "Parameters" not in text and "parameters are those" not in text):
                    missing.append(f"{path.name}:{node.name}")
    # Commands describe themselves to their users; the command line prints these texts.
    assert [name for name in missing if not name.startswith("app.py")] == []


@pytest.mark.parametrize("path", [path for path in MODULES if path.name == "__init__.py"], ids=lambda p: p.parent.name)
def test_package_files_only_re_export(path):
    allowed = (ast.Expr, ast.Import, ast.ImportFrom, ast.Assign)
    assert all(isinstance(node, allowed) for node in ast.parse(path.read_text(encoding="utf-8")).body)
