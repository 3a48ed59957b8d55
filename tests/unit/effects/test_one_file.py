"""One effect, one file: the machinery names no effect."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import cpfls_cli
from cpfls_cli.effects.registry import CATALOGUE

PACKAGE = Path(cpfls_cli.__file__).parent
ELSEWHERE = [path for path in sorted(PACKAGE.rglob("*.py")) if "catalogue" not in path.parts]

# Help for people, which may give an example: nothing is decided by it.
MENTIONS = {
    ("stages/effects.py", "rotor_drag"),
    ("simulation/settings.py", "motor_lag"),
    ("simulation/settings.py", "battery_sag"),
}
# A line of the header of a blackbox log, and what makes rotors uneven, which are called like effects.
OF_OTHERS = {("logs/blackbox.py", "gyro_scale")}
UNEVEN = {("look/answers.py", "wind"), ("look/balance.py", "wind")}
# The vehicle's own numbers are part of every fit; what they mean stands in their own file, which the fits import.
IMPORTED = {"parameter_error"}


@cache
def read(path):
    """Literals of a module, and the modules that it imports from; its tree is not kept."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    # Strings that stand alone: docstrings of modules, classes, functions and constants.
    alone = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    strings = [node for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    texts = [node.value for node in strings if id(node) not in alone]
    return texts, [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]


def literals(path):
    return read(path)[0]


def test_no_effect_is_named_outside_the_catalogue():
    named = {(str(path.relative_to(PACKAGE)), text) for path in ELSEWHERE for text in literals(path)}
    assert {(path, text) for path, text in named if text in CATALOGUE} == OF_OTHERS | UNEVEN


def test_texts_mention_effects_only_as_examples():
    names = re.compile(rf"\b({'|'.join(name for name in CATALOGUE if '_' in name)})\b")
    mentions = {
        (str(path.relative_to(PACKAGE)), name)
        for path in ELSEWHERE
        for text in literals(path)
        for name in names.findall(text)
    }
    templates = [path for path in PACKAGE.rglob("templates/*") if path.is_file()]
    assert mentions == MENTIONS | OF_OTHERS
    assert [path.name for path in templates if names.search(path.read_text(encoding="utf-8"))] == []


def test_only_the_numbers_of_the_vehicle_are_imported_from_the_catalogue():
    prefix = "cpfls_cli.effects.catalogue"
    imported = {
        module.removeprefix(f"{prefix}.")
        for path in ELSEWHERE
        for module in read(path)[1]
        if module.startswith(f"{prefix}.")
    }
    assert imported == IMPORTED


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=list(CATALOGUE))
def test_labels_of_the_audit_are_those_of_the_numbers(effect):
    if effect.test is not None:
        assert len(effect.test.labels) == len(effect.numbers)
