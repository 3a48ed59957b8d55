"""Load a study config: read, override, validate, and report every error at once."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from cpfls_cli.config.check import check_data, gone_lines
from cpfls_cli.config.study import Study, parse_yaml, resolved
from cpfls_cli.errors import ConfigError, SettingError

_LARGEST = 1_000_000
_MALFORMED = "write section.key=value"
ASK = "ASK"
"""Stands in a config for what only a person knows; `cpfls init` writes it."""


def load_study(path: Path, overrides: Sequence[str] = (), seed: int | None = None) -> Study:
    """Load and validate a study, with overrides ``section.key=value`` (YAML)."""
    data = read_overridden(path, overrides, seed)
    # Nobody's file is of the vehicle that a study begins with: without the section its keys are missing.
    data.setdefault("vehicle", {})
    return validate(data, str(path), wrong=gone_lines(data, str(path)))


def read_overridden(path: Path, overrides: Sequence[str] = (), seed: int | None = None) -> dict[str, Any]:
    """Read a config file as plain data, with the keys that the command line overrides."""
    data = read_config(path)
    for override in overrides:
        apply_override(data, override)
    if seed is not None:
        data["seed"] = seed
    return data


def read_config(path: Path) -> dict[str, Any]:
    """Read a config file as plain data."""
    try:
        with path.open("rb") as stream:
            # No more of what has no end, such as a device; a pipe is as good as a file.
            content = stream.read(_LARGEST + 1)
        text = content.decode("utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot read the config: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; a config is YAML in UTF-8") from None
    if len(content) > _LARGEST:
        raise ConfigError(f"{path}: is larger than {_LARGEST / 1e6:g} MB, which no config is")
    return parse_config(text, str(path))


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


def stored_study(config: str, path: object) -> Study:
    """Read the study that an artifact was made with; the path is for messages."""
    source = f"{path}: /config"
    return validate(parse_config(config, source), source)


def parse_config(text: str, source: str) -> dict[str, Any]:
    """Read the text of a config as plain data."""
    data = parse_yaml(text, source)
    if data is None:
        raise ConfigError(f"{source}: the config is empty; `cpfls config` prints a commented default")
    if not isinstance(data, dict):
        raise ConfigError(f"{source}: a config is a mapping of sections; this is a {type(data).__name__}")
    return data


def flat_keys(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """List all keys with dots, each with its value."""
    for key, value in config.items():
        if isinstance(value, Mapping) and value:
            yield from flat_keys(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def validate(data: dict[str, Any], source: str, *, wrong: Sequence[str] = ()) -> Study:
    """Validate plain data as a study, in addition to what is known to be wrong."""
    _refuse_asked(data, source)
    study, found = check_data(data, source)
    errors = [*wrong, *found]
    if study is None or errors:
        raise ConfigError("\n".join(errors))
    return study


def _refuse_asked(data: dict[str, Any], source: str) -> None:
    """Refuse a config in which something is still asked, naming every such key in one sentence."""
    keys = list(_asked(data, ""))
    if keys:
        one = len(keys) == 1
        raise ConfigError(
            f"{source}: {', '.join(keys)} = {ASK}: no log says {'it' if one else 'them'}; write what is true of the"
            f" vehicle in place of {ASK}{how_to_fill_in(keys)}"
        )


_EXAMPLES: Final = {"mass_kg": "0.8", "position_m": "[0.1, -0.1, 0.0]", "spin": "1"}
_MEANT: Final = {
    "mass_kg": "kg, with battery",
    "position_m": "x forward, y left and z up from the centre of mass, m",
    "spin": "1 counter-clockwise seen from above, -1 clockwise",
}
_FILLED_IN_BY: Final = {"mass_kg": "--mass KG", "position_m": "--arm M"}


def how_to_fill_in(keys: Iterable[str], *, brief: bool = False, **known: str) -> str:
    """Give an example of what to write for each of some keys, once for all rotors, what it means, and what else may.

    Parameters
    ----------
    keys : iterable of str
        With dots, as `ASK` stands at them.
    brief : bool
        Without what they mean, and without examples where a command fills them in.
    known : str
        Values that are better examples, by the last part of a key.
    """
    names = dict.fromkeys(key.rpartition(".")[2] for key in keys)
    if "rotors" in names:
        names = {name: None for name in (*names, "position_m", "spin") if name != "rotors"}
    shown = [name for name in names if name in _EXAMPLES]
    if not shown:
        return ""
    values = ", ".join(f"{name}: {known.get(name, _EXAMPLES[name])}" for name in shown)
    # Where it is known how rotors turn, it is known where they are up to the length of the arms.
    options = [option for name, option in _FILLED_IN_BY.items() if name in shown and "spin" not in shown]
    by_init = f"; cpfls init {' '.join(options)} fills {'it' if len(shown) == 1 else 'them'} in" if options else ""
    if brief:
        return by_init or f", such as {values}"
    return f", such as {values} ({'; '.join(_MEANT[name] for name in shown)}){by_init}"


def _asked(node: Any, path: str) -> Iterator[str]:
    if node == ASK:
        yield path
    entries = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in entries:
        yield from _asked(value, f"{path}.{key}" if path else str(key))
