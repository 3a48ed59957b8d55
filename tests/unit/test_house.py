"""The rules of the house that no linter knows: short functions, documented public names, quiet packages."""

import ast
import itertools
import re
from pathlib import Path
from statistics import median

import pytest

import cpfls_cli
from cpfls_cli.result import datasets
from cpfls_cli.stages.info import formats
from tests.builders.sources import nodes, syntax

PACKAGE = Path(cpfls_cli.__file__).parent
TESTS = Path(__file__).parents[1]
MODULES = sorted(PACKAGE.rglob("*.py"))
LONGEST, LONGEST_CLASS = 60, 250
PATHS = {path for stage in formats() for path, _ in datasets(stage.kind) if "/" in path and "*" not in path}


def functions(path):
    return [node for node in nodes(path) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]


def body_lines(function):
    """Lines of code without the docstring: a full description of shapes and units must not cost length."""
    start = function.body[1] if ast.get_docstring(function) and len(function.body) > 1 else function.body[0]
    return function.end_lineno - start.lineno + 1


def test_functions_are_short_and_classes_of_one_thought():
    lengths = {f"{path}:{f.name}": body_lines(f) for path in MODULES for f in functions(path)}
    assert {name: length for name, length in lengths.items() if length > LONGEST} == {}
    assert median(lengths.values()) <= 25
    # With their docstrings, which grow with the attributes: a class that is longer does several things.
    classes = [(path, node) for path in MODULES for node in nodes(path) if isinstance(node, ast.ClassDef)]
    lengths = {f"{path}:{node.name}": node.end_lineno - node.lineno + 1 for path, node in classes}
    assert {name: length for name, length in lengths.items() if length > LONGEST_CLASS} == {}


def documented(path):
    """Public functions, classes and methods at the top of a module, by name."""
    for node in syntax(path).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
            for own in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(own, ast.FunctionDef) and not own.name.startswith("_"):
                    yield f"{node.name}.{own.name}", own


def sections(text):
    """Entries of the numpydoc sections of a docstring: each a list of lines, by section."""
    found, name, lines = {}, None, text.splitlines()
    for line, following in itertools.pairwise([*lines, ""]):
        if re.fullmatch(r"-{3,}", following) and line.strip():
            name = line.strip()
            found[name] = []
        elif name and line.strip() and not re.fullmatch(r"-{3,}", line):
            found[name] += [[line]] if not line.startswith(" ") or not found[name] else []
            found[name][-1] += [line] if line.startswith(" ") else []
    return found


def repeats_signature(entry, section):
    """Tell whether an entry is a bare type: no word of meaning, no shape, no unit, no range."""
    kind = entry[0].partition(" : ")[2] if section == "Parameters" else entry[0]
    return len(entry) == 1 and not re.search(r"[,\[\]()<>]", re.sub(r", optional$", "", kind))


def test_docstrings_do_not_repeat_signatures():
    """A section stands where at least one of its entries adds shape, unit, frame, range or meaning."""
    bare, unknown = [], []
    for path in MODULES:
        for name, node in documented(path):
            found = sections(ast.get_docstring(node) or "")
            for section in ("Parameters", "Returns", "Yields"):
                entries = found.get(section, [])
                if entries and all(repeats_signature(entry, section) for entry in entries):
                    bare.append(f"{path.relative_to(PACKAGE)}: {name}: {section}")
            if isinstance(node, ast.FunctionDef):
                taken = {
                    a.arg
                    for a in (
                        *node.args.posonlyargs,
                        *node.args.args,
                        *node.args.kwonlyargs,
                        node.args.vararg,
                        node.args.kwarg,
                    )
                    if a
                }
                listed = {
                    n.strip(" *") for entry in found.get("Parameters", []) for n in entry[0].split(" : ")[0].split(",")
                }
                unknown += [f"{path.relative_to(PACKAGE)}: {name}: {n}" for n in sorted(listed - taken)]
    assert bare == []
    assert unknown == []


@pytest.mark.parametrize("path", [path for path in MODULES if path.name == "__init__.py"], ids=lambda p: p.parent.name)
def test_package_files_only_re_export(path):
    allowed = (ast.Expr, ast.Import, ast.ImportFrom, ast.Assign)
    assert all(isinstance(node, allowed) for node in syntax(path).body)


def looked_up(node):
    """Give the dataset that a piece of code looks up by its path; None for other code."""
    return node.value if isinstance(node, ast.Constant) and node.value in PATHS else None


def test_no_dataset_is_looked_up_by_its_path():
    """A path is written once, at a field of a result; everything else reads the field."""
    lookups = {
        path.relative_to(PACKAGE).as_posix(): list(filter(None, map(looked_up, nodes(path)))) for path in MODULES
    }
    assert {name: texts for name, texts in lookups.items() if texts} == {}


def imported_tests(path):
    """Names below `tests` that a module imports, wherever in it the import stands."""
    for module, names in re.findall(r"^ *(?:from (\S+) )?import (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE):
        if module.startswith((".", "tests.")):
            yield module
        else:
            each = (f"{module}.{name}".lstrip(".") for name in names.split(", "))
            yield from (name for name in each if name.startswith("tests"))


def test_tests_import_from_shared_builders_alone():
    """What tests of several packages build stands in `tests/builders`, which holds no tests."""
    wrong = [
        f"{path.relative_to(TESTS)}: {name}"
        for path in sorted(TESTS.rglob("*.py"))
        for name in imported_tests(path)
        if not f"{name}.".startswith("tests.builders.")
    ]
    assert wrong == []
    assert [path.name for path in TESTS.glob("builders/test_*.py")] == []


# A module lives for two users or for more than about 80 lines of code. These are one thing of many of a kind, each
# looked up by its place: a command, an effect, a reader of logs, a simulator that is exported to or whose file is read.
ONE_OF_A_KIND = ("autopilots/catalogue/", "effects/catalogue/", "export/simulators/", "logs/", "simulators/", "stages/")
SMALL_ALL_THE_SAME = {"cli/main.py": "runs before anything heavy is loaded"}
FEW_LINES = 80


def lines_of_code(path):
    """Count lines without docstrings, comments, imports and blank lines."""
    left_out = set()
    for node in nodes(path):
        is_text = (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        if is_text or isinstance(node, ast.Import | ast.ImportFrom):
            left_out |= set(range(node.lineno, node.end_lineno + 1))
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
    return sum(bool(line.strip()) and not line.strip().startswith("#") and n not in left_out for n, line in lines)


def test_a_module_has_two_users_or_is_long_enough():
    names = {".".join(("cpfls_cli", *path.relative_to(PACKAGE).with_suffix("").parts)): path for path in MODULES}
    users = {name: set() for name in names}
    for user, path in names.items():
        for node in nodes(path):
            if isinstance(node, ast.ImportFrom) and node.module and path.name != "__init__.py":
                for used in {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)} & names.keys():
                    users[used].add(user)
    small = {
        path.relative_to(PACKAGE).as_posix()
        for name, path in names.items()
        if len(users[name]) < 2 and lines_of_code(path) < FEW_LINES and not path.name.startswith("__")
    }
    found = {name for name in small if not name.startswith(ONE_OF_A_KIND)}
    assert found == set(SMALL_ALL_THE_SAME), "a short module with one user belongs into it, or into another module"
