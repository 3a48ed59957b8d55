"""Identified models with other numbers than those that were found."""

from dataclasses import replace

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.result import described_fields
from cpfls_cli.store import read, write

EVIDENCE_PARTS = (*("structures", "residuals", "uncertainty", "curves", "round_trip", "steps", "physics", "verdict"),)


def changed(given, path, value):
    """Replace a field of a result by its path, such as ``judged/mse``."""
    name, _, rest = path.partition("/")
    return replace(given, **{name: changed(getattr(given, name), rest, value) if rest else value})


def with_parts(given, values):
    """Replace fields by their paths; of a part that is missing all of its fields, of one that shall be, none."""
    by_part = {}
    for path, value in values.items():
        name, _, rest = path.partition("/")
        if rest and (getattr(given, name) is None or value is None):
            by_part.setdefault(name, {})[rest] = value
        else:
            given = changed(given, path, value)
    kinds = {own.name: own.inner for own in described_fields(type(given)) if own.about is None}
    made = {
        name: None if any(each is None for each in part.values()) else kinds[name](**part)
        for name, part in by_part.items()
    }
    return replace(given, **made)


def write_changed(source, target, **values):
    """Write a model again with other values: names of fields, with two underscores for each slash."""
    given, origin = read(source, IdentifiedModel)
    write(target, with_parts(given, {name.replace("__", "/"): value for name, value in values.items()}), origin)
    return target
