"""Limits on the derivatives of a move: as a config states them, and as planning takes them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
from annotated_types import Gt
from typing_extensions import Doc

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings

_Positive = Annotated[float, Gt(0)]
_Limit = _Positive | tuple[_Positive, _Positive, _Positive] | None


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Largest absolute value allowed to each derivative of a move, in m and s; infinite where there is none.

    An array gives every move its own limit.
    """

    velocity: float | Array = np.inf
    acceleration: float | Array = np.inf
    jerk: float | Array = np.inf
    snap: float | Array = np.inf
    crackle: float | Array = np.inf
    pop: float | Array = np.inf

    def __post_init__(self) -> None:
        """Refuse limits that are zero, negative or no numbers."""
        for field in fields(self):
            require_positive(field.name, getattr(self, field.name), "leave it out for no limit")

    def broadcast(self, moves: int) -> Array:
        """Broadcast the limits to all moves, shape (6, moves); `SettingError` where a length fits neither."""
        return np.stack([broadcast_to_moves(field.name, getattr(self, field.name), moves) for field in fields(self)])


LIMIT_NAMES = tuple(field.name for field in fields(Limits))


def require_positive(key: str, value: float | Array, remedy: str) -> None:
    """Refuse values that are not greater than zero, with their name and what else could be done about it."""
    values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    wrong = ~(values > 0)
    if wrong.any():
        raise SettingError(key, f"is {values[wrong][0]:g}; must be greater than 0, or {remedy}")


def broadcast_to_moves(key: str, value: float | Array, moves: int) -> Array:
    """Broadcast one value to all moves; `SettingError` where it is neither one nor one for each."""
    values = np.asarray(value, dtype=np.float64)
    if values.shape not in ((), (1,), (moves,)):
        raise SettingError(key, f"has shape {values.shape} for {moves} moves; give one value, or one for each move")
    return np.broadcast_to(values, (moves,))


@dataclass(frozen=True, kw_only=True)
class LimitSettings(Settings):
    """Limit the derivatives of every move; a number for all, or one for each of x, y, z, or null for none."""

    velocity_m_s: Annotated[_Limit, Doc("largest velocity, m/s")] = None
    acceleration_m_s2: Annotated[_Limit, Doc("largest acceleration, m/s^2")] = None
    jerk_m_s3: Annotated[_Limit, Doc("largest jerk, m/s^3")] = None
    snap_m_s4: Annotated[_Limit, Doc("largest snap, m/s^4")] = None
    crackle_m_s5: Annotated[_Limit, Doc("largest crackle, m/s^5")] = None
    pop_m_s6: Annotated[_Limit, Doc("largest pop, m/s^6")] = None

    @property
    def given(self) -> dict[str, float | tuple[float, float, float]]:
        """The limits that are not null, by key."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {key: value for key, value in values.items() if value is not None}

    def of_axes(self, axes: IntArray) -> Limits:
        """Limits of some of the axes x, y, z, each for itself; every entry has the shape of `axes`, (n,)."""
        return Limits(**{_derivative(key): np.broadcast_to(value, 3)[axes] for key, value in self.given.items()})

    def along(self, direction: Array) -> Limits:
        """Limits on a move along a straight line.

        Parameters
        ----------
        direction : array, shape (3,)
            World vector that one metre of the move moves along. Limits axis by axis hold for each component, a
            single number for the move itself.
        """
        return Limits(**{_derivative(key): _along(value, direction) for key, value in self.given.items()})


def _derivative(key: str) -> str:
    return key.split("_", 1)[0]


def _along(value: float | tuple[float, float, float], direction: Array) -> float:
    if not isinstance(value, tuple):
        return value
    moving = direction != 0
    return float(np.min(np.array(value)[moving] / np.abs(direction[moving])))
