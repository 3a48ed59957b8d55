"""Limits on the derivatives of a move."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Largest absolute value allowed to each derivative of a move, in m and s; infinite where there is none.

    Attributes
    ----------
    velocity, acceleration, jerk, snap, crackle, pop : float or array, shape (moves,)
        Derivatives one to six; an array gives every move its own limit.
    """

    velocity: float | Array = np.inf
    acceleration: float | Array = np.inf
    jerk: float | Array = np.inf
    snap: float | Array = np.inf
    crackle: float | Array = np.inf
    pop: float | Array = np.inf

    def __post_init__(self) -> None:
        """Refuse limits that no move can keep.

        Raises
        ------
        SettingError
            If a limit is zero, negative or not a number; it names the limit.
        """
        for field in fields(self):
            require_positive(field.name, getattr(self, field.name), "leave it out for no limit")

    def broadcast(self, moves: int) -> Array:
        """Give every move its limits.

        Returns
        -------
        array, shape (6, moves)
            In the order of the attributes.

        Raises
        ------
        SettingError
            If the length of a limit is neither one nor the number of moves.
        """
        return np.stack([spread(field.name, getattr(self, field.name), moves) for field in fields(self)])


LIMIT_NAMES = tuple(field.name for field in fields(Limits))


def require_positive(key: str, value: float | Array, remedy: str) -> None:
    """Refuse what is not greater than zero.

    Parameters
    ----------
    key : str
        Name of the value, for the message.
    value : float or array
    remedy : str
        What else could be done about it, for the message.

    Raises
    ------
    SettingError
        Names the key and the first wrong value.
    """
    values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    wrong = ~(values > 0)
    if wrong.any():
        raise SettingError(key, f"is {values[wrong][0]:g}; must be greater than 0, or {remedy}")


def spread(key: str, value: float | Array, moves: int) -> Array:
    """Give every move the one value, or its own.

    Parameters
    ----------
    key : str
        Name of the value, for the message.
    value : float or array, shape (moves,)
    moves : int

    Returns
    -------
    array, shape (moves,)

    Raises
    ------
    SettingError
        If the length is neither one nor the number of moves.
    """
    values = np.asarray(value, dtype=np.float64)
    if values.shape not in ((), (1,), (moves,)):
        raise SettingError(key, f"has shape {values.shape} for {moves} moves; give one value, or one for each move")
    return np.broadcast_to(values, (moves,))
