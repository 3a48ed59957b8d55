"""The keys in which the configs of several studies differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_LONGEST = 60
_ABSENT = "not there"
# What a page looks like does not change a model.
_LEFT_OUT = ("report",)


def differences(configs: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """Find the keys whose values differ.

    Parameters
    ----------
    configs : sequence of mapping
        Resolved studies.

    Returns
    -------
    list of (str, list of str)
        Dotted key, and its value in each study; long values are cut.
    """
    flat = [dict(_flat(config)) for config in configs]
    keys = dict.fromkeys(key for one in flat for key in one)
    values = {key: [one.get(key, _ABSENT) for one in flat] for key in keys}
    return [(key, list(map(_short, own))) for key, own in values.items() if len(set(map(str, own))) > 1]


def _flat(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in config.items():
        if not above and key in _LEFT_OUT:
            continue
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _short(value: Any) -> str:
    text = {None: "null", True: "true", False: "false"}.get(value, str(value)) if _plain(value) else str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _plain(value: Any) -> bool:
    return value is None or isinstance(value, bool)
