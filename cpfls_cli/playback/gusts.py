"""Gusts: a torque and a force that nothing predicts, as random processes with a size and a memory by body axis."""

from __future__ import annotations

from typing import Annotated, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.filters import recursion
from cpfls_cli.result import About

GUST_AXES = ("roll", "pitch", "yaw", "x", "y", "z")
"""Torque about the body axes, then force along them."""


class Gusts(NamedTuple):
    """A Gauss-Markov process on each body axis: ``x' = -x / memory + white noise``, of standard deviation `size`."""

    size: Annotated[
        Array, About("standard deviation of torque (N m), then force (N); 0 for none", ("6",), "SI", "body (FLU)")
    ]
    memory: Annotated[Array, About("time in which a gust falls to 37 %", ("6",), "s", "body (FLU)")]
    white: Annotated[
        Array,
        About(
            "white noise with it, N m s^0.5 and N s^0.5: over a step of h s its standard deviation is white / sqrt(h)",
            ("6",),
            "SI",
            "body (FLU)",
        ),
    ] = np.zeros(len(GUST_AXES))

    @classmethod
    def known(cls, size: Array, memory: Array, white: Array | None = None) -> Self:
        """Take what is known of the first axes, and none elsewhere."""
        columns = [np.zeros(len(GUST_AXES)), np.ones(len(GUST_AXES)), np.zeros(len(GUST_AXES))]
        for column, given, there in zip(columns, (size, memory, white), (size, size, white), strict=True):
            if given is not None and there is not None:
                known = np.flatnonzero(np.isfinite(there))
                column[known] = given[known]
        return cls(*columns)

    def drawn(self, rng: np.random.Generator, step: float, count: int) -> Array:
        """Draw torque and force at instants a step apart, exactly, from the first on as large as at any.

        Parameters
        ----------
        step : float, s
        count : int

        Returns
        -------
        array, shape (count, 6), N m and N, body frame

        References
        ----------
        Gillespie 1996, Exact numerical simulation of the Ornstein-Uhlenbeck process.
        """
        keep = np.exp(-step / self.memory)
        fresh = rng.standard_normal((count, len(keep)))
        fresh[1:] *= np.sqrt(1.0 - keep**2)
        columns = [recursion([-each], column) for each, column in zip(keep, fresh.T, strict=True)]
        pushed = self.size * np.stack(columns, axis=1)
        if np.any(self.white):
            pushed += self.white / np.sqrt(step) * rng.standard_normal(pushed.shape)
        return np.asarray(pushed)


class GustAxis(NamedTuple):
    """Gusts about or along an axis, with 95 % intervals, in units of acceleration; NaN where not known.

    Attributes
    ----------
    name : str
        roll, pitch, yaw, or x, y, z.
    """

    name: str
    size: float
    low: float
    high: float
    memory: float
    memory_low: float
    memory_high: float

    @property
    def turns(self) -> bool:
        """Whether it is a torque."""
        return self.name in GUST_AXES[:3]
