"""A battery that empties, and sags a little under load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array

_LOWEST = 0.05


@dataclass(frozen=True)
class Battery:
    """Voltage as a share of the full battery, ``V = 1 - use t / T - load (P / P_hover - 1)`` with P ~ sum w_i^3.

    Attributes
    ----------
    use : float
        Share lost by the end of the flight.
    load : float
        Share lost under twice the hover power.
    duration : float, s
        T.
    hover_cubed : float, rad^3/s^3
        Sum of the cubed rotor speeds in hover.
    """

    use: float
    load: float
    duration: float
    hover_cubed: float

    def voltage(self, time: float, rotor_speed: Array) -> float:
        """Compute the voltage.

        Parameters
        ----------
        time : float, s
            From take-off.
        rotor_speed : array, shape (rotor,), rad/s
        """
        power = float(np.sum(rotor_speed**3)) / self.hover_cubed
        return max(1 - self.use * time / self.duration - self.load * (power - 1), _LOWEST)
