"""Fill in what a preset says of keys that a config leaves out."""

from __future__ import annotations

from typing import Any

from cpfls_cli.identification.presets import PRESETS

_SECTION = "identification"


def with_preset(data: dict[str, Any]) -> dict[str, Any]:
    """Put the values of the preset that a config names under its own keys.

    Parameters
    ----------
    data : dict
        Plain data of a config.

    Returns
    -------
    dict
        The same where no preset is named, or none that exists.
    """
    section = data.get(_SECTION)
    if not isinstance(section, dict):
        return data
    values = next((values for name, values in PRESETS.items() if name == section.get("preset")), {})
    return data | {_SECTION: {**values, **section}}
