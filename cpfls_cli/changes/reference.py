"""What flights of an unchanged vehicle differ by among themselves: the floor that a change has to stand above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.changes.numbers import KINDS, FlightNumbers
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import VehicleSettings

FEWEST = 3
"""Reference flights that tell their scatter; of fewer, what is usual has to stand for it."""

_DAYS = 3.0
"""Reference flights that what is usual counts as."""

_OFFSET_M = 0.0005
"""By which the centre of mass lies elsewhere from day to day: a battery put back."""

_BY_VOLTAGE, _VOLTAGE_ERROR = -1.0, 1.0
"""Power of the voltage that a command of hover goes with, and how far that is off, before any flight tells: none where
the autopilot makes up for the battery, the square where it does not."""


@dataclass(frozen=True)
class Reference:
    """Numbers of reference flights: their mean and covariance.

    Attributes
    ----------
    names : tuple of str
        Numbers that all flights tell, today's too.
    mean : array, shape (number,)
    covariance : array, shape (number, number)
        Of the mean of flights of one other day beside that of the reference.
    freedom : float
        Degrees of freedom of the covariance.
    measured : array, shape (number,)
        Mean variance by which a number of one flight is off, by its blocks; it is in the covariance.
    by_voltage, voltage_error : float
        Power of the voltage that loads go with, and its error; 0 where they need no voltage.
    voltage : float
        Of the mean; NaN where it does not count.
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array
    freedom: float
    measured: Array
    by_voltage: float
    voltage_error: float
    voltage: float

    @classmethod
    def of(cls, flights: Sequence[FlightNumbers], names: Sequence[str], vehicle: VehicleSettings) -> Reference:
        """Learn from reference flights, at least one.

        A conjugate prior (inverse Wishart, in blocks by kind) holds what is usual from day to day; it counts as three
        flights. The covariance is that of the predictive distribution, a multivariate t.

        Parameters
        ----------
        names : sequence of str
            Numbers to take, which all of them have.

        References
        ----------
        Gelman et al. 2013, Bayesian Data Analysis, section 3.6.
        """
        values = np.array([[flight.values[name] for name in names] for flight in flights])
        loads = np.array([name.startswith("load ") for name in names])
        power, error, voltage = _by_voltage(flights, values, loads)
        if loads.any() and np.isfinite(voltage):
            own = np.array([flight.voltage for flight in flights])
            values[:, loads] -= power * np.log(own / voltage)[:, None]
        usual, mean = usual_covariance(names, vehicle), values.mean(axis=0)
        apart = values - mean
        kinds = np.array([name.split()[0] for name in names])
        seen = (apart.T @ apart) * (kinds[:, None] == kinds)
        measured = _measured(flights, names)
        freedom = _DAYS + len(flights) - 1
        # Scatter of flights holds the error of each; what is usual from day to day comes beside that.
        expected = usual + np.diag(measured)
        covariance = (_DAYS * expected + seen) / freedom * (1 + 1 / len(flights))
        return cls(tuple(names), mean, covariance, freedom, measured, power, error, voltage)

    def apart(self, flights: Sequence[FlightNumbers]) -> tuple[Array, Array]:
        """Compute how far flights of a day are from the reference, shape (flight, number), and the covariance.

        Loads are those at the reference's voltage; how sure that is is in the covariance, which is that of their mean:
        flights of a day have their day in common.
        """
        values = np.array([[flight.values[name] for name in self.names] for flight in flights])
        loads = np.array([name.startswith("load ") for name in self.names])
        # Flights that tell a number worse than those of the reference do.
        beside = _measured(flights, self.names) / len(flights) - self.measured
        covariance = self.covariance + np.diag(np.maximum(beside, 0.0))
        voltage = np.array([flight.voltage for flight in flights])
        if loads.any() and np.isfinite(self.voltage) and np.isfinite(voltage).all():
            lower = np.log(voltage / self.voltage)
            values[:, loads] -= self.by_voltage * lower[:, None]
            covariance += (self.voltage_error * lower.mean()) ** 2 * np.outer(loads, loads)
        return values - self.mean, covariance


def _measured(flights: Sequence[FlightNumbers], names: Sequence[str]) -> Array:
    """Average the variances of numbers over flights, shape (number,)."""
    return np.asarray(np.mean([[flight.errors[name] ** 2 for name in names] for flight in flights], axis=0))


def common_numbers(flights: Sequence[FlightNumbers]) -> tuple[str, ...]:
    """List the numbers that all flights tell, in the order of the first."""
    return tuple(name for name in flights[0].values if all(name in flight.values for flight in flights))


def usual_covariance(names: Sequence[str], vehicle: VehicleSettings) -> Array:
    """Compute what numbers of a vehicle that nobody changed usually do from day to day, shape (number, number)."""
    kinds = [KINDS[name.split()[0]] for name in names]
    sensors = np.array([" ".join(name.split()[:-1]) for name in names])
    apart, together = np.array([kind.apart for kind in kinds]), np.array([kind.together for kind in kinds])
    covariance = np.diag(apart**2) + np.outer(together, together) * (sensors[:, None] == sensors)
    loads = np.array([name.startswith("load ") for name in names])
    moved = _OFFSET_M * load_directions(vehicle).offset
    covariance[np.ix_(loads, loads)] += moved[:, _placed(names, loads)].T @ moved[:, _placed(names, loads)]
    return np.asarray(covariance)


@dataclass(frozen=True)
class LoadDirections:
    """What a change does to the logarithms of the rotors' loads in hover.

    Attributes
    ----------
    rotor : array, shape (rotor, rotor)
        Of each rotor that lacks a share of its thrust and drag, for a whole share.
    mass : array, shape (rotor,)
        For a relative change of the mass.
    offset : array, shape (2, rotor)
        Of the centre of mass along x and y, per m.
    yaw : array, shape (rotor,)
        Of a torque about z, for as much as all rotors' drag.
    """

    rotor: Array
    mass: Array
    offset: Array
    yaw: Array


def load_directions(vehicle: VehicleSettings) -> LoadDirections:
    """Compute what changes do to the rotors' loads.

    An autopilot that hovers asks for squared speeds that balance weight and torques, of least norm where there are more
    than four rotors.
    """
    allocation = allocation_matrix(vehicle)
    scale = np.linalg.norm(allocation, axis=1)
    inverse = np.linalg.pinv(allocation / scale[:, None]) / scale
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    hover = inverse @ np.array([weight, 0.0, 0.0, 0.0])
    # A centre of mass further along x leaves the rotors' thrust behind it: they have to raise the nose.
    wanted = weight * np.array([[0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    drag = np.array([rotor.drag_factor_n_m_s2 for rotor in vehicle.rotors]) @ hover
    return LoadDirections(
        rotor=(inverse @ allocation @ np.diag(hover)).T / hover,
        mass=np.ones(len(hover)),
        offset=wanted @ inverse.T / hover,
        yaw=drag * inverse[:, 3] / hover,
    )


def _placed(names: Sequence[str], loads: BoolArray) -> list[int]:
    """Give the rotor of each load."""
    return [int(name.split("M")[-1]) - 1 for name, load in zip(names, loads, strict=True) if load]


def _by_voltage(flights: Sequence[FlightNumbers], values: Array, loads: BoolArray) -> tuple[float, float, float]:
    """Regress the mean load on the logarithm of the voltage: the power, its error, and the voltage of the reference.

    Loads of speeds that were measured need no voltage.
    """
    voltage = np.array([flight.voltage for flight in flights])
    if not loads.any() or not np.isfinite(voltage).all() or not all(flight.commanded for flight in flights):
        return 0.0, 0.0, float("nan")
    usual = float(np.exp(np.log(voltage).mean()))
    lower, mean = np.log(voltage / usual), values[:, loads].mean(axis=1)
    noise = KINDS["load"].together ** 2 + KINDS["load"].apart ** 2 / loads.sum()
    information = (lower**2).sum() / noise + 1 / _VOLTAGE_ERROR**2
    power = ((lower * (mean - mean.mean())).sum() / noise + _BY_VOLTAGE / _VOLTAGE_ERROR**2) / information
    return float(power), float(information**-0.5), usual
