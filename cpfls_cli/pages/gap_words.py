"""Channels, signals and effects of the gap workflow in words that a pilot knows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.pages.source import Source
from cpfls_cli.report.numbers import number

AXES = ("x (roll)", "y (pitch)", "z (yaw)")
CHANNELS = {
    "torque x": "torque about x (roll)",
    "torque y": "torque about y (pitch)",
    "torque z": "torque about z (yaw)",
    "force x": "force along x (forward)",
    "force y": "force along y (left)",
    "force z": "force along z (up)",
}
_TORQUE, _FORCE = "N\N{NO-BREAK SPACE}m", "N"
_SIGNAL_UNITS = {
    "time": "s",
    "body rate": "rad/s",
    "roll": "rad",
    "pitch": "rad",
    "yaw": "rad",
    "air velocity": "m/s",
    "speed": "m/s",
    "horizontal speed": "m/s",
    "vertical speed": "m/s",
    "height": "m",
    "rotor speed": "rad/s",
    "thrust": "N",
    "rotor torque": "N m",
    "voltage": "share of full",
}
_LEAST_P = 1e-6


def channel_words(channel: str) -> str:
    """Say what a channel is."""
    return CHANNELS.get(channel, channel)


def channel_unit(channel: str) -> str:
    """Give the unit of a channel."""
    return _TORQUE if channel.startswith("torque") else _FORCE


def signal_words(signal: str) -> str:
    """Name a signal with its unit."""
    unit = _SIGNAL_UNITS.get(signal) or _SIGNAL_UNITS.get(signal.rsplit(" ", 1)[0])
    return f"{signal}, {unit}" if unit else signal


def effect_title(name: str) -> str:
    """Say what people call an effect."""
    return CATALOGUE[name].title if name in CATALOGUE else name.replace("_", " ")


def joined(words: Iterable[str], last: str = "and") -> str:
    """Join words to a phrase, without repeating one.

    Parameters
    ----------
    last : str
        Before the last word.
    """
    *others, final = dict.fromkeys(words)
    return f"{', '.join(others)} {last} {final}" if others else final


def unit_words(unit: str) -> str:
    """Write a unit as people do.

    Parameters
    ----------
    unit : str
        With powers such as ``^2``; ``1`` for none.
    """
    return "" if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def sentence(text: str) -> str:
    """Write words as a sentence.

    Returns
    -------
    str
        With a capital letter, unless a file name comes first, and a full stop.
    """
    first = text.split(" ", 1)[0]
    start = text if "." in first or "_" in first else f"{text[:1].upper()}{text[1:]}"
    return start if start.endswith((".", "?", "!")) else f"{start}."


def probability(value: float) -> str:
    """Write a probability; the smallest ones by a bound."""
    return "< 10⁻⁶" if value < _LEAST_P else number(value, 2)


def whole_percent(share: float) -> str:
    """Write a share in whole per cent."""
    if not math.isfinite(share):
        return number(share)
    if 0 < abs(share) < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 <= share < 1 else f"{100 * share:.0f} %".replace("-", "−")


def known_channels(source: Source, path: str) -> list[tuple[int, str]]:
    """List the channels of a gap that are known.

    Parameters
    ----------
    path : str
        Of the sizes, by channel.

    Returns
    -------
    list of (int, str)
        Index and name.
    """
    known = np.isfinite(source.artifact.array(path))
    return [(index, name) for index, name in enumerate(source.artifact.texts("gap/channel")) if known[index]]


def titles_of(source: Source, kinds: Sequence[str] = ("wrench", "actuator", "sensor", "parameter")) -> list[str]:
    """List what an artifact names, by titles.

    Parameters
    ----------
    source : Source
        A diagnosis or an extended model.
    kinds : sequence of str
        Kinds of effects to list.
    """
    artifact = source.artifact
    rows = zip(
        artifact.texts("effect/name"), artifact.texts("effect/kind"), artifact.array("effect/named"), strict=True
    )
    return [effect_title(name) for name, kind, named in rows if named and kind in kinds]
