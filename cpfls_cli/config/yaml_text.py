"""YAML without surprises: `1e-3` is a number, `on` is a string, and duplicate keys are refused."""

from __future__ import annotations

import re
from copy import deepcopy
from functools import lru_cache
from typing import Any

import yaml

from cpfls_cli.errors import ConfigError

_TAG = "tag:yaml.org,2002:"
_FLOAT = re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$")
_MOST_VALUES = 100_000
_INT = re.compile(r"^[-+]?(0|[1-9][0-9]*)$")
_MOST_DIGITS = 400
"""More than a float holds, and fewer than Python converts."""


class _StudyLoader(yaml.SafeLoader):
    """A safe loader with YAML 1.2 numbers and booleans, no dates, no duplicate keys, and nothing that JSON lacks."""


_StudyLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag in {_TAG + "null", _TAG + "merge"}]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_StudyLoader.yaml_constructors = {
    tag: construct
    for tag, construct in yaml.SafeLoader.yaml_constructors.items()
    if tag is None or tag.removeprefix(_TAG) in {"null", "bool", "int", "float", "str", "seq", "map"}
}
_StudyLoader.add_implicit_resolver(_TAG + "int", _INT, list("-+0123456789"))
_StudyLoader.add_implicit_resolver(_TAG + "float", _FLOAT, list("-+0123456789."))
_StudyLoader.add_implicit_resolver(_TAG + "bool", re.compile(r"^(true|True|TRUE|false|False|FALSE)$"), list("tTfF"))


def _mapping_without_duplicates(loader: _StudyLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    loader.flatten_mapping(node)
    mapping: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str):
            raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is not text", key_node.start_mark)
        if key in mapping:
            raise yaml.constructor.ConstructorError(None, None, f"key '{key}' appears twice", key_node.start_mark)
        mapping[key] = loader.construct_object(value_node, deep=True)
    return mapping


def _whole_number(loader: _StudyLoader, node: yaml.ScalarNode) -> int:
    if len(node.value) > _MOST_DIGITS:
        raise yaml.constructor.ConstructorError(None, None, f"a number of {len(node.value)} digits", node.start_mark)
    return int(loader.construct_yaml_int(node))


_StudyLoader.add_constructor(_TAG + "int", _whole_number)
_StudyLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_duplicates)


def parse_yaml(text: str, source: str) -> Any:
    """Parse one YAML document into dict, list, str, int, float, bool and None."""
    try:
        return deepcopy(_parsed(text))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise ConfigError(f"{source}{where}: not valid YAML: {error.problem}") from None
    except RecursionError:
        raise ConfigError(f"{source}: lists or mappings are nested deeper than in any config") from None
    except (yaml.YAMLError, ValueError, LookupError, TypeError, ArithmeticError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ConfigError(f"{source}: not valid YAML: {reason}") from None


@lru_cache(maxsize=8)
def _parsed(text: str) -> Any:
    """Parse a document once: the artifacts that a command reads and writes mostly hold one and the same config."""
    loader = _StudyLoader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _written_out(node, {})
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _written_out(node: yaml.Node, known: dict[int, int]) -> int:
    """Count the values of a document with every alias written out; a node that is being counted counts 0."""
    if id(node) in known:
        if not known[id(node)]:
            raise yaml.constructor.ConstructorError(None, None, "an anchor that holds itself", node.start_mark)
        return known[id(node)]
    known[id(node)] = 0
    count = 1
    if isinstance(node, yaml.ScalarNode):
        if any("\ud800" <= character <= "\udfff" for character in node.value):
            problem = f"{node.value[:40]!r} holds half a character"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
    else:
        # The entries of a mapping are pairs.
        inner = (part for entry in node.value for part in (entry if isinstance(entry, tuple) else (entry,)))
        count += sum(_written_out(part, known) for part in inner)
    if count > _MOST_VALUES:
        problem = f"more than {_MOST_VALUES} values with every alias written out"
        raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
    known[id(node)] = count
    return count


def to_yaml(data: Any) -> str:
    """Write plain data, as `parse_yaml` gives them, as YAML with keys in their given order."""
    return str(yaml.dump(data, Dumper=_StudyDumper, sort_keys=False, default_flow_style=False, width=100))


class _StudyDumper(yaml.SafeDumper):
    """Writes short lists on one line and floats that read back as floats."""


def _represent_list(dumper: _StudyDumper, data: list[Any]) -> yaml.Node:
    flat = not any(isinstance(item, dict | list) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


_StudyDumper.add_representer(list, _represent_list)
# Text such as 1e-3 is quoted, because the loader above takes it for a number.
_StudyDumper.add_implicit_resolver(_TAG + "float", _FLOAT, list("-+0123456789."))
