"""Effects as the command line gives them, ``NAME=VALUE[,VALUE...]`` or ``NAME.coefficient=VALUE``."""

from __future__ import annotations

import json
from collections.abc import Sequence

from cpfls_cli.effects.registry import effect as find
from cpfls_cli.errors import InputError

_FORM = "write NAME=VALUE[,VALUE...] or NAME.coefficient=VALUE, see `cpfls effects NAME`"


def simulation_overrides(mode: str | None, effects: Sequence[str]) -> list[str]:
    """Write the options of `cpfls simulate` as overrides of the config, so that the artifact's config has them too.

    Parameters
    ----------
    mode : str or None
        None keeps that of the config.

    Returns
    -------
    list of str
        ``section.key=value`` each.

    Raises
    ------
    InputError
        If an effect is malformed, unknown, or given twice.
    """
    given: dict[str, list[float] | dict[str, float]] = {}
    for text in effects:
        _add(text, given)
    chosen = [] if mode is None else [f"simulation.mode={mode}"]
    # JSON is YAML, and numbers keep all their digits.
    return [*chosen, *(f"simulation.closed_loop.effects.{name}={json.dumps(value)}" for name, value in given.items())]


def _add(text: str, given: dict[str, list[float] | dict[str, float]]) -> None:
    key, _, written = text.partition("=")
    name, dot, entry = key.strip().partition(".")
    find(name)
    values = _numbers(text, written)
    before = given.get(name)
    if not dot and before is None:
        given[name] = values
        return
    if not dot or isinstance(before, list) or entry in (before or {}):
        raise InputError(f"--effect {text}: {name} is given twice; {_FORM}")
    if len(values) != 1 or not entry:
        raise InputError(f"--effect {text}: a coefficient takes one value; {_FORM}")
    given[name] = {**(before or {}), entry: values[0]}


def _numbers(text: str, written: str) -> list[float]:
    try:
        return [float(value) for value in written.split(",")] if written.strip() else []
    except ValueError:
        raise InputError(f"--effect {text}: {written} is not a number; {_FORM}") from None
