"""YAML that means what it says."""

import pytest

from cpfls_cli.config.study import parse_yaml, to_yaml
from cpfls_cli.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("-.5", -0.5),
        ("1.", 1.0),
        ("+3", 3),
        ("0", 0),
        ("true", True),
        ("null", None),
        ("~", None),
        ("on", "on"),
        ("yes", "yes"),
        ("1:30", "1:30"),
        ("0x10", "0x10"),
        ("1_000", "1_000"),
        ("2001-01-01", "2001-01-01"),
        ("010", 10.0),
    ],
)
def test_scalars(text, value):
    parsed = parse_yaml(text, "file")
    assert parsed == value
    assert type(parsed) is type(value)


@pytest.mark.parametrize(
    "text", ["1e-3", "-.5", "1.", ".inf", "on", "yes", "1:30", "0x10", "1_000", "2001-01-01", "010", "", "null", "# no"]
)
def test_text_that_looks_like_something_else_stays_text(text):
    assert parse_yaml(to_yaml({"title": text}), "file") == {"title": text}


def test_merge_keys_and_anchors_are_plain_yaml():
    assert parse_yaml("a: &a {x: 1}\nb: {<<: *a, y: 2}\n", "file") == {"a": {"x": 1}, "b": {"x": 1, "y": 2}}


def test_messages_name_line_and_column():
    with pytest.raises(ConfigError, match=r"^file:2:1: not valid YAML: key 'a' appears twice$"):
        parse_yaml("a: 1\na: 2\n", "file")
