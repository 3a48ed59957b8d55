"""Check the plain data of a config, key by key: a study, or every error at once, one line for each key."""

from __future__ import annotations

import copy
import difflib
import json
import logging
import textwrap
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import ValidationError
from pydantic_core import ErrorDetails
from typing_extensions import Doc

from cpfls_cli.config.study import SECTIONS, Study, parse_yaml, resolved, to_yaml
from cpfls_cli.config.unknown import KEYS, with_guesses
from cpfls_cli.errors import SettingError
from cpfls_cli.identification.settings import PRESETS
from cpfls_cli.inertia import MEASURED, symmetric
from cpfls_cli.vehicle.rotors import figures_of_vehicle
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle_limits import beyond_any_vehicle

Choice = str | int | None
_ENTRIES = {tuple, list, dict, Mapping}
_UNIONS = {Union, types.UnionType}
_WIDTH = 110
_EXAMPLES: Final = MappingProxyType(
    {
        "signals": (
            "attitude: {columns: [roll, pitch, yaw], unit: deg}",
            "body_torque: {columns: [mx, my, mz], unit: N mm, sign: [1, -1, -1]}",
        )
    }
)


@dataclass(frozen=True)
class Key:
    """One key of a config.

    `section`: the settings class below it; `many`: whether it holds a list or a mapping of such; `choices`: the only
    values allowed; `entries`: names that the entries of a mapping may have. Empty where there are none.
    """

    name: str
    doc: str
    section: type | None
    many: bool
    choices: tuple[Choice, ...]
    entries: tuple[Choice, ...]


@cache
def keys_of(settings: type) -> tuple[Key, ...]:
    """List the keys of a settings class."""
    hints = get_type_hints(settings, include_extras=True)
    if settings is Study:
        names = {name: field.alias or name for name, field in Study.model_fields.items()}
    else:
        names = {field.name: field.name for field in fields(settings)}
    return tuple(_key(shown, hints[name]) for name, shown in names.items())


def _key(name: str, hint: Any) -> Key:
    return Key(name, _doc(hint), *_section(hint), _choices(hint) or (), _entries(hint))


def known_keys(location: Sequence[str], deep: bool = False) -> list[str]:
    """List the valid keys of a section, or the dotted paths of all below; names and indices of entries do not count."""
    settings: type | None = Study
    parts = iter(location)
    for part in parts:
        key = next((key for key in keys_of(settings) if key.name == part), None) if settings else None
        settings = key.section if key else None
        if key is not None and key.many and next(parts, None) is None:
            return []
    if settings is None:
        return []
    return list(_paths(settings)) if deep else [key.name for key in keys_of(settings)]


def _paths(settings: type, prefix: str = "") -> Iterator[str]:
    for key in keys_of(settings):
        yield prefix + key.name
        if key.section is not None:
            yield from _paths(key.section, f"{prefix}{key.name}.")


def _doc(hint: Any) -> str:
    if get_origin(hint) is not Annotated:
        return ""
    return next((note.documentation for note in get_args(hint)[1:] if isinstance(note, Doc)), "")


def _section(hint: Any, many: bool = False) -> tuple[type | None, bool]:
    """Find the settings class inside a hint such as ``Annotated[tuple[RotorSettings, ...], ...]``."""
    if is_dataclass(hint) and isinstance(hint, type):
        return hint, many
    origin = get_origin(hint)
    if origin is Annotated or origin in _UNIONS or origin in _ENTRIES:
        pairs = (_section(part, many or origin in _ENTRIES) for part in get_args(hint))
        return next((pair for pair in pairs if pair[0] is not None), (None, False))
    return None, False


def _choices(hint: Any) -> tuple[Choice, ...] | None:
    """Find the values of a hint such as ``Literal["s", "ms"] | None``; None where it allows others too."""
    origin = get_origin(hint)
    if origin is Literal:
        return get_args(hint)
    if hint is types.NoneType:
        return (None,)
    if origin is Annotated:
        return _choices(get_args(hint)[0])
    if origin not in _UNIONS:
        return None
    parts = [_choices(part) for part in get_args(hint)]
    return None if None in parts else tuple(value for part in parts if part for value in part)


def _entries(hint: Any) -> tuple[Choice, ...]:
    """Find the names that the entries of a mapping or a list may have."""
    if get_origin(hint) is Annotated:
        return _entries(get_args(hint)[0])
    return _choices(get_args(hint)[0]) or () if get_origin(hint) in {dict, Mapping, tuple} else ()


def commented_default() -> str:
    """Write the default study as YAML with a comment on every key: its meaning and the values that it may have."""
    return "\n".join(_commented(Study, resolved(Study()), 0)) + "\n"


def _commented(settings: type, data: dict[str, Any], depth: int) -> Iterator[str]:
    indent = "  " * depth
    for key in keys_of(settings):
        value = data[key.name]
        if key.section is not None and isinstance(value, dict) and set(value) == {k.name for k in keys_of(key.section)}:
            yield f"{indent}{key.name}:  # {key.doc}" if key.doc else f"{indent}{key.name}:"
            yield from _commented(key.section, value, depth + 1)
            continue
        yield from (f"{indent}# {line}" for line in _comment(key))
        yield from (indent + line for line in to_yaml({key.name: value}).rstrip("\n").split("\n"))


def _comment(key: Key) -> Iterator[str]:
    if key.doc:
        yield key.doc
    yield from _listed("one of", key.choices)
    yield from _listed("names:", key.entries)
    for below in keys_of(key.section) if key.section is not None else ():
        yield f"  {below.name}: {below.doc}"
        yield from (f"    {line}" for line in _listed("one of", below.choices))
    if key.name in _EXAMPLES:
        yield "example, to write below the key instead of {}:"
        yield from (f"  {line}" for line in _EXAMPLES[key.name])


def _listed(words: str, values: Sequence[Choice]) -> list[str]:
    listed = ", ".join(map(_written, values))
    return textwrap.wrap(f"{words} {listed}", _WIDTH, break_on_hyphens=False) if values else []


def _written(value: Choice) -> str:
    """Write a value as it must stand in a config: text that reads as a number needs quotes."""
    if value is None:
        return "null"
    return str(value) if parse_yaml(str(value), "choices") == value else f"'{value}'"


_PAPER = "remove it; `make reproduce` writes the page that compares a study with the paper"
_CONTROL = "a model is flown by `simulate --model` in closed loop; examples/computed_torque.py controls with one"
_LOOP = "remove it; a loop over `cpfls identify --seed N --set KEY=VALUE` searches again (docs/long-searches.md)"
_GONE = {
    ("report", "evaluation_times"): _PAPER,
    ("report", "paper"): _PAPER,
    ("simulation", "computed_torque"): f"remove it; {_CONTROL}",
    **{("sweep", key): _LOOP for key in ("seeds", "set", "settings")},
    ("trajectory.next_flight", "to_tell"): "call it separate",
}
"""What to do about keys that configs of before hold; inside artifacts they are left out, in a file they are refused."""

_WITHOUT_EFFECT = {("playback", "generations"), ("playback", "population")}
"""Keys of before that no result of today depends on: they are left out, with a warning."""

_PRESET_SECTION = "identification"
_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_LENGTH = {"too_short", "too_long"}
_LONGEST_VALUE = 60
_CORRECTED = 1.5  # Largest principal moment over the sum of the others that flights correct: two 30 % too small.
_PLAIN_WORDS = {
    "must be a valid array": "must be a list",
    "must be an object": "must be a section of keys",
    "must be a valid dictionary": "must be a section of keys",
    "must be a valid string": "must be text",
    "must be a valid boolean": "must be true or false",
    "must be a valid integer": "must be a whole number",
    "must be a valid number": "must be a number",
    "Field required": "is missing",
}
_OF_A_VEHICLE = ("mass_kg", "inertia_kg_m2", "rotors", "rotor_speed_max_rad_s")
_OF_A_ROTOR = ("position_m", "spin", "thrust_factor_n_s2", "drag_factor_n_m_s2")
_KEYS_OF = {
    "mass": "mass_kg",
    "gravity": "gravity_m_s2",
    "inertia": KEYS["inertia"],
    "speed_max": "rotor_speed_max_rad_s",
    "arm": "rotors.{}.position_m",
    "radius": "rotors.{}.radius_m",
    "thrust_factor": f"rotors.{{}}.{KEYS['thrust_factor']}",
    "drag_factor": f"rotors.{{}}.{KEYS['drag_factor']}",
}
"""Keys of the section `vehicle` by the names of `vehicle_limits`."""

Location = tuple[str, ...]


def check_data(data: dict[str, Any], source: str) -> tuple[Study | None, list[str]]:
    """Validate plain data as a study, None where there are errors, with a line for each wrong key."""
    # A section that is named but left empty means its defaults.
    named = {key: {} if value is None and key in SECTIONS else _known(key, value) for key, value in data.items()}
    named.pop("sweep", None)
    filled = with_guesses(_with_preset(named))
    missing = [_missing_line(source, key) for key in _left_out(named)]
    try:
        study = Study.model_validate_json(json.dumps(filled))
    except ValidationError as error:
        errors = [*error.errors(), *_hidden_errors(filled, error.errors())]
        return None, [*missing, *_describe_errors(errors, filled, source)]
    wrong = missing or [f"{source}: {line}" for line in no_body(study, _CORRECTED)]
    wrong = wrong or [_line(location, [why], filled, source) for location, why in _no_vehicle(study.vehicle)]
    return (None if wrong else study), wrong


def _known(section: str, values: Any) -> Any:
    if not isinstance(values, dict):
        return values
    left = {key: value for key, value in values.items() if (section, key) not in _WITHOUT_EFFECT.union(_GONE)}
    return {key: _known(f"{section}.{key}", value) for key, value in left.items()}


def gone_lines(data: dict[str, Any], source: str) -> list[str]:
    """Say of the keys of a file that are gone what to do; warn of those that have no effect any more."""

    def held(section: str) -> Any:
        values: Any = data
        for name in section.split("."):
            values = values.get(name) if isinstance(values, dict) else None
        return values if isinstance(values, dict) else {}

    for section, key in sorted(_WITHOUT_EFFECT):
        if key in held(section):
            logging.getLogger("cpfls_cli").warning("%s: %s.%s has no effect any more; remove it", source, section, key)
    return [
        f"{source}: {section}.{key}: is no longer a key: {remedy}"
        for (section, key), remedy in _GONE.items()
        if key in held(section)
    ]


def no_body(study: Study, most: float = MEASURED) -> Iterator[str]:
    """Say which moments of inertia are those of no body: a principal one is at most the sum of the others.

    Of a flat vehicle it is the sum, so that an error in one moment is enough: a config is refused beyond what flights
    can correct only. A guess, where a config leaves the moments open, is not stated by it.
    """
    why = why_no_body(study.vehicle, most)
    if why and "inertia" not in study.vehicle.unknown:
        yield (
            f"vehicle.inertia_kg_m2 = {json.dumps(study.vehicle.inertia_kg_m2)}: {why}; check the units and the "
            "order Ixx, Iyy, Izz, Ixy, Ixz, Iyz"
        )


def why_no_body(vehicle: VehicleSettings, most: float = MEASURED) -> str:
    """Say why no body has the inertia of a vehicle; empty where one can, but for a factor that errors may have."""
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(vehicle.inertia_kg_m2))
    if largest <= (smallest + middle) * most:
        return ""
    return (
        f"no body has this inertia: its largest principal moment, {largest:.4g}, exceeds the sum of the other two, "
        f"{smallest + middle:.4g}"
    )


def _no_vehicle(vehicle: VehicleSettings) -> Iterator[tuple[Location, str]]:
    """Refuse numbers that no vehicle has, key by key; nothing of guesses."""
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    radii = (place for place, rotor in enumerate(vehicle.rotors) if rotor.radius_m is not None)
    places = {"arm": int(np.argmax(np.abs(hubs).max(axis=1))), "radius": next(radii, 0)}
    for name, why in beyond_any_vehicle(figures_of_vehicle(vehicle)):
        yield ("vehicle", *_KEYS_OF[name].format(places.get(name, 0)).split(".")), why


def _missing_line(source: str, key: str) -> str:
    remedy = "state it, or null if it is not known" if key.rsplit(".", 1)[-1] in KEYS.values() else "state it"
    return f"{source}: {key}: is missing; a vehicle has no defaults: {remedy} (`cpfls init` writes the section)"


def _left_out(data: dict[str, Any]) -> Iterator[str]:
    """List the keys of a vehicle that a config lacks: the number of another vehicle is no default for it."""
    vehicle = data.get("vehicle")
    if not isinstance(vehicle, dict):
        return
    yield from (f"vehicle.{key}" for key in _OF_A_VEHICLE if key not in vehicle)
    rotors = vehicle.get("rotors")
    for place, rotor in enumerate(rotors if isinstance(rotors, list) else ()):
        if isinstance(rotor, dict):
            yield from (f"vehicle.rotors.{place}.{key}" for key in _OF_A_ROTOR if key not in rotor)


def _hidden_errors(data: dict[str, Any], errors: list[ErrorDetails]) -> list[ErrorDetails]:
    """Find errors that an unknown key hides: rules between keys run only where all keys of a section are known."""
    try:
        Study.model_validate_json(json.dumps(_without_unknown_keys(data, errors)))
    except ValidationError as error:
        return error.errors()
    return []


def _with_preset(data: dict[str, Any]) -> dict[str, Any]:
    """Fill in the values of the preset that a config names; keys that are given win."""
    section = data.get(_PRESET_SECTION)
    if not isinstance(section, dict):
        return data
    values = next((values for name, values in PRESETS.items() if name == section.get("preset")), {})
    return data | {_PRESET_SECTION: {**values, **section}}


def _describe_errors(errors: Iterable[ErrorDetails], data: dict[str, Any], source: str) -> list[str]:
    """Describe every wrong key: ``file: dotted.key = value: what is wrong (did you mean ...?)``."""
    # Where a key allows several types, each of them has an error of its own; a line joins them.
    reasons: dict[Location, dict[Sequence[int | str], str]] = {}
    not_of_length: set[Location] = set()
    for detail in errors:
        alternative = detail["loc"]
        location = _location(detail, data)
        if _lacks_entry(detail):
            alternative, location = alternative[:-1], location[:-1]
        if (reason := _reason(detail, location, data)) is not None:
            reasons.setdefault(location, {})[alternative] = reason
            not_of_length |= set() if _lacks_entry(detail) or detail["type"] in _LENGTH else {location}
    # Where an entry of a list is wrong, only alternatives of another length report an error of the list itself.
    entries = [location for location in reasons if location in not_of_length]
    reported = [
        location
        for location in reasons
        if location in not_of_length
        or not any(len(entry) > len(location) and entry[: len(location)] == location for entry in entries)
    ]
    return [_line(location, reasons[location].values(), data, source) for location in reported]


def _without_unknown_keys(data: dict[str, Any], errors: Iterable[ErrorDetails]) -> dict[str, Any]:
    """Copy the data of a config without the keys that the errors call unknown."""
    kept = copy.deepcopy(data)
    for detail in errors:
        *parents, last = _location(detail, data) or ("",)
        exists, section = _value(kept, tuple(parents))
        if detail["type"] in _UNKNOWN and exists and isinstance(section, dict):
            section.pop(last, None)
    return kept


def _line(location: Location, reasons: Iterable[str], data: dict[str, Any], source: str) -> str:
    exists, value = _value(data, location)
    text = json.dumps(value)
    if len(text) > _LONGEST_VALUE:
        text = text[:_LONGEST_VALUE] + " ..."
    shown = f" = {text}" if exists and not isinstance(value, dict) else ""
    return f"{source}: {'.'.join(location)}{shown}: {' or '.join(dict.fromkeys(reasons))}"


def _location(detail: ErrorDetails, data: dict[str, Any]) -> Location:
    """Drop the parts of a location that name alternatives of a type, and add the key of a combination rule."""
    location: list[str] = []
    node: Any = data
    for part in detail["loc"]:
        if isinstance(part, int):
            node = node[part] if isinstance(node, list) and part < len(node) else None
        elif isinstance(node, dict) and (part in node or detail["type"] == "missing"):
            node = node.get(part)
        else:
            continue
        location.append(str(part))
    cause = detail.get("ctx", {}).get("error")
    return (*location, *(cause.key.split(".") if isinstance(cause, SettingError) else ()))


def _lacks_entry(detail: ErrorDetails) -> bool:
    return detail["type"] == "missing" and isinstance(detail["loc"][-1], int)


def _value(data: Any, location: Location) -> tuple[bool, Any]:
    for part in location:
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and part.isdecimal() and int(part) < len(data):
            data = data[int(part)]
        else:
            return False, None
    return True, data


def _reason(detail: ErrorDetails, location: Location, data: dict[str, Any]) -> str | None:
    if detail["type"] in _UNKNOWN:
        return "unknown key" + _nearest(location)
    if _lacks_entry(detail):
        return f"needs {int(detail['loc'][-1]) + 1} entries"
    if detail["type"] in _LENGTH:
        return _length(detail, _value(data, location)[1])
    if location == ("simulation", "mode") and _value(data, location)[1] == "computed-torque":
        return f"is no longer a mode: leave it out; {_CONTROL}"
    message = detail["msg"].removeprefix("Value error, ")
    message = message.replace("Input should be ", "must be ", 1) if message.startswith("Input should be ") else message
    return _PLAIN_WORDS.get(message, message)


def _length(detail: ErrorDetails, value: Any) -> str | None:
    """Describe the length that is needed; None where entries only count as missing because they are wrong."""
    context = detail.get("ctx", {})
    if detail["type"] == "too_long":
        return f"needs {context.get('max_length')} entries at most"
    least = int(context.get("min_length", 0))
    return None if isinstance(value, list) and len(value) >= least else f"needs {least} entries at least"


def _nearest(location: Location) -> str:
    """Suggest the key that was meant: of this name in another section, or of a similar name in this one."""
    keys = known_keys(location[:-1])
    elsewhere = [path for path in known_keys([], deep=True) if path.rsplit(".", 1)[-1] == location[-1]]
    near = difflib.get_close_matches(location[-1], keys, n=1, cutoff=0.5)
    if elsewhere or near:
        meant = [*elsewhere, *near][0]
        # Who leaves the unit out of the name may mean another one, such as samples.
        return f" (did you mean '{meant}'{', which is in seconds' if meant == f'{location[-1]}_s' else ''}?)"
    return f" (valid here: {', '.join(keys)})" if keys else ""
