"""Overrides of a config: from the command line, and by the settings of a sweep."""

from __future__ import annotations

import copy
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cpfls_cli.config.check import check_data
from cpfls_cli.config.study import Study, resolved
from cpfls_cli.config.yaml_text import parse_yaml
from cpfls_cli.errors import ConfigError, SettingError

_MALFORMED = "write section.key=value"
_AS_CONFIGURED = "as configured"
_SWEEP = "sweep"
_OVERRIDABLE = ("reduction", "identification")
_PRESET = "identification.preset"


def apply_override(data: dict[str, Any], override: str) -> None:
    """Apply ``section.key=value`` in place; entries of lists go by index, a list left out is the default one."""
    key, separator, text = override.partition("=")
    try:
        if not separator:
            raise SettingError(key, _MALFORMED)
        _override_key(data, key.strip(), parse_yaml(text, f"--set {key}"))
    except SettingError as error:
        raise ConfigError(f"--set {override}: {error}") from None


def _override_key(data: dict[str, Any], key: str, value: Any) -> None:
    """Set one key, written with dots, in the data of a config; the data are changed in place."""
    parts = key.split(".")
    if not all(parts):
        raise SettingError(key, _MALFORMED)
    *parents, last = parts
    node: Any = data
    # A vehicle has no defaults: what its config leaves out is reported as missing.
    default: Any = {section: values for section, values in resolved(Study()).items() if section != "vehicle"}
    for parent, following in itertools.pairwise(parts):
        default = default.get(parent) if isinstance(default, dict) else None
        node = _enter(node, parent, default, key)
        if node == {} and following.isdecimal():
            raise SettingError(key, f"the config holds no list '{parent}', and there is no default for it")
    if isinstance(node, list):
        node[_index(node, last, key)] = value
    elif isinstance(node, dict):
        node[last] = value
    else:
        raise SettingError(key, f"'{'.'.join(parents)}' is a single value and has no keys")


def _enter(node: Any, name: str, default: Any, key: str) -> Any:
    if isinstance(node, list):
        return node[_index(node, name, key)]
    if not isinstance(node, dict):
        raise SettingError(key, f"'{name}' is below a single value")
    if node.get(name) is None:
        node[name] = copy.deepcopy(default) if isinstance(default, list) else {}
    return node[name]


def _index(entries: list[Any], name: str, key: str) -> int:
    if not name.isdecimal() or int(name) >= len(entries):
        raise SettingError(key, f"'{name}' is not an index of a list of {len(entries)}; indices count from 0")
    return int(name)


@dataclass(frozen=True)
class Variant:
    """A study that a sweep runs: the config with the overrides of one setting.

    Attributes
    ----------
    overrides : tuple of str
        ``section.key=value`` each; as options of ``--set`` they make the same study of the same config.
    study : Study
        Without a sweep of its own.
    reduced : bool
        Whether it learns from a reduced set, not from all samples that train.
    """

    name: str
    overrides: tuple[str, ...]
    study: Study
    reduced: bool


def variants(study: Study) -> tuple[Variant, ...]:
    """Build the studies of a sweep, one for each setting, or the study itself where it names none."""
    data, common = resolved(study), study.sweep.set
    if not study.sweep.settings:
        return (_variant(data, _AS_CONFIGURED, common),)
    return tuple(_variant(data, setting.name, common | setting.set) for setting in study.sweep.settings)


def setting_errors(data: Mapping[str, Any], source: str, known: Sequence[str]) -> list[str]:
    """List errors of the settings of a sweep that the config has not without them, at the keys that they override."""
    sweep = data.get(_SWEEP)
    common = _mapping(_mapping(sweep).get("set"))
    settings = _mapping(sweep).get("settings")
    everywhere = _errors_with(data, source, common)
    errors = {} if settings else {f"{_SWEEP}.set: {line}": None for line in everywhere}
    for number, setting in enumerate(settings if isinstance(settings, list) else ()):
        for line in _errors_with(data, source, common | _mapping(_mapping(setting).get("set"))):
            errors[f"{_SWEEP}.{'' if line in everywhere else f'settings.{number}.'}set: {line}"] = None
    reported = {line.removeprefix(f"{source}: ") for line in known}
    return [f"{source}: {line}" for line in errors if line.split(": ", 1)[1] not in reported]


def _mapping(data: Any) -> dict[str, Any]:
    """Return a mapping as it is and anything else as empty; another check reports that."""
    return data if isinstance(data, dict) else {}


def _errors_with(data: Mapping[str, Any], source: str, overrides: Mapping[str, Any]) -> list[str]:
    """List the errors of a config whose keys are overridden."""
    try:
        return [line.removeprefix(f"{source}: ") for line in check_data(_overridden(data, overrides)[0], source)[1]]
    except SettingError as error:
        return [f"{error.key} = {json.dumps(overrides[error.key])}: {error}"]


def _variant(data: Mapping[str, Any], name: str, overrides: Mapping[str, Any]) -> Variant:
    overridden, reduced = _overridden(data, overrides)
    study, errors = check_data(overridden, name)
    if study is None:
        raise ConfigError("\n".join(errors))
    return Variant(name, tuple(f"{key}={json.dumps(value)}" for key, value in overrides.items()), study, reduced)


def _overridden(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> tuple[dict[str, Any], bool]:
    """Override keys of a config, and tell whether it still has a reduction."""
    result = copy.deepcopy({key: value for key, value in data.items() if key != _SWEEP})
    for key, value in overrides.items():
        if key.split(".")[0] not in _OVERRIDABLE:
            raise SettingError(key, f"a setting of a sweep overrides keys of {' and '.join(_OVERRIDABLE)} only")
        if key in _OVERRIDABLE:
            raise SettingError(key, f"is a section; name its keys one by one, with a dot: {key}.KEY")
        if key == _PRESET:
            raise SettingError(key, "stands for keys that the config leaves out; name the keys that differ")
        _override_key(result, key, value)
    reduction = result.get("reduction")
    if not isinstance(reduction, dict) or reduction.get("size", 0) is not None or reduction.get("condition_number"):
        return result, True
    # A reduction that nothing stops is none; its size is not used.
    if "reduction.size" in overrides or "reduction.condition_number" in overrides:
        del reduction["size"]
        return result, False
    return result, True
