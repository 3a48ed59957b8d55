"""The numbers that `gap` has next to settings and ranges of effects: few, and each with its reason on a page."""

import ast
import re
from pathlib import Path

import cpfls_cli

GAP = Path(cpfls_cli.__file__).parent / "gap"
PAGE = Path(__file__).parents[3] / "docs" / "gap-method.md"
MOST = 43


def numbers():
    """Module and name of all constants that hold a number."""
    for path in sorted(GAP.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.Assign):
                continue
            holds = (each.value for each in ast.walk(node.value) if isinstance(each, ast.Constant))
            names = [each.id for each in ast.walk(node.targets[0]) if isinstance(each, ast.Name)]
            if any(isinstance(each, int | float) for each in holds):
                module = ".".join(path.relative_to(GAP).with_suffix("").parts)
                yield from ((module, name) for name in names if name.strip("_").isupper())


def listed():
    """Module and name of each row of the table on the page."""
    text = PAGE.read_text(encoding="utf-8").split("\n## Constants\n")[1].split("\n## ")[0]
    for module, names in re.findall(r"^\| `([a-z_.]+)` \| ([^|]+) \|", text, re.MULTILINE):
        yield from ((module, name) for name in re.findall(r"`([A-Z_]+)`", names))


def test_each_number_is_on_the_page_with_its_reason_and_there_are_few():
    assert sorted(listed()) == sorted(numbers())
    assert len(list(numbers())) <= MOST
