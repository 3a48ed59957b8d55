"""What flights of an unchanged vehicle differ by among themselves: the floor that a change has to exceed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.changes.numbers import KINDS, FlightNumbers
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import VehicleSettings

FEWEST = 3  # Reference flights that identify their scatter; of fewer, what is usual replaces it.
_DAYS = 6.0  # Reference flights that what is usual counts as.
_SCALE_ERROR = 0.8
"""By how much numbers of a kind scatter relative to what is usual, from vehicle to vehicle: deviation of the logarithm,
of shares of thrust, vibration and batteries of four."""

_FEWEST_LEFT = 4.0
"""Degrees of freedom of what is usual of vehicles, where there is hardly any reference flight: one kind of numbers in
a hundred then scatters by more than 3.7 times what is usual. Of four vehicles none did by more than one and a half."""

FALSE_ALARM = 0.01  # Probability at which flights of an unchanged vehicle are said to have changed.
EACH_TEST = FALSE_ALARM / 2
"""The same of each of the two tests, of which either says so: of known changes, and of each number by itself."""

_OFFSET_M = 0.001  # By which the centre of mass lies elsewhere from day to day: a battery put back.
_BY_VOLTAGE, _VOLTAGE_ERROR = {"thrust": -1.0, "turn": 1.0}, 1.0
"""Power of the voltage that numbers of commands go with, and how far that is off, before any flight: none where
the autopilot makes up for the battery, the square where it does not."""

_BY_TURNING = 0.05
"""Torque about z that turning takes against the air: standard deviation, for 1 rad/s, over all rotors' drag."""

_CALM = 1.0  # Acceleration below which flights are flown alike, m/s^2.


@dataclass(frozen=True)
class Reference:
    """Numbers of reference flights: their mean and covariance."""

    names: tuple[str, ...]  # Numbers that all flights have, today's too.
    mean: Array  # Shape (number,).
    covariance: Array  # Shape (number, number): of the mean of flights of one other day less that of the reference.
    freedom: Array  # Shape (number,): degrees of freedom of the covariance; of numbers of a kind the same.
    # Shape (number,): mean variance by which a number of one flight is off, by its blocks; it is in the covariance.
    measured: Array
    # `by_voltage`, `voltage_error`: shape (number,): power of the voltage that a number goes with, and its error, which
    # all of a kind have in common; 0 where it goes with none.
    by_voltage: Array
    voltage_error: Array
    voltage: float  # Of the mean; NaN where it does not count.
    by_agility: Array  # Shape (number,): by how much a number goes with the logarithm of how agile a flight is flown.
    agility_error: Array  # Shape (number,): its standard error; 0 where it does not count.
    agility: float  # That logarithm of the mean; NaN where it does not count.
    turning: float  # Mean yaw rate whose torque the shares of thrust hold, rad/s.
    by_turning: Array  # Shape (number,): standard deviation, for 1 rad/s, of what that torque does to each number.

    @classmethod
    def of(cls, flights: Sequence[FlightNumbers], names: Sequence[str], vehicle: VehicleSettings) -> Reference:
        """Learn from reference flights, at least one.

        A conjugate prior (inverse Wishart, in blocks by kind) holds what is usual from day to day; it counts as six
        flights. The covariance is that of the predictive distribution, a multivariate t. Numbers go with how agile
        flights are flown by a regression with a prior of its own: where the reference flights are all flown alike,
        flights that are not count the less the more they differ.

        `names`: numbers to take, which all of them have.
        Reference: Gelman et al. 2013, Bayesian Data Analysis, section 3.6.
        """
        values = np.array([[flight.values[name] for name in names] for flight in flights])
        power, error, voltage = _by_voltage(flights, names, values)
        if np.isfinite(voltage):
            values -= np.outer(np.log([flight.voltage / voltage for flight in flights]), power)
        mean, measured = values.mean(axis=0), _measured(flights, names)
        expected = expected_covariance(flights, names, vehicle)
        apart, slope, prior, agility, spread = _by_agility(flights, names, values - mean, np.diag(expected))
        covariance, freedom = learned_covariance(apart, len(flights) - 1.0, expected, names)
        noise = np.diag(covariance)
        unsure = np.sqrt(noise / (spread + noise / prior)) if np.isfinite(agility) else np.zeros(len(names))
        return cls(
            *(tuple(names), mean, covariance * (1 + 1 / len(flights)), freedom, measured, power, error, voltage),
            *(slope, unsure, agility, float(np.mean([flight.turning for flight in flights]))),
            _by_turning(names, vehicle),
        )

    def apart(self, flights: Sequence[FlightNumbers]) -> tuple[Array, Array]:
        """Compute how far flights of a day are from the reference, shape (flight, number), and the covariance.

        What goes with the voltage and with how agile they are flown is that at the reference's; how sure that is counts
        in the covariance. It is that of their mean: flights of a day have their day in common.
        """
        values = np.array([[flight.values[name] for name in self.names] for flight in flights])
        # Flights with a larger error than those of the reference.
        excess = _measured(flights, self.names) / len(flights) - self.measured
        more = self.more_agile(flights)
        values -= np.outer(more, self.by_agility)
        unlike = np.abs(more).mean() * self.agility_error
        covariance = self.covariance + np.diag(np.maximum(excess, 0.0))
        covariance += np.outer(unlike, unlike) * 0.5 * (_alike(self.names) + np.eye(len(self.names)))
        turned = self.turned_more(flights).mean(axis=0)
        covariance += np.outer(turned, turned)
        voltage = np.array([flight.voltage for flight in flights])
        if np.isfinite(self.voltage) and np.isfinite(voltage).all():
            lower = np.log(voltage / self.voltage)
            values -= np.outer(lower, self.by_voltage)
            unsure = lower.mean() * self.voltage_error
            covariance += np.outer(unsure, unsure) * _alike(self.names)
        return values - self.mean, covariance

    def more_agile(self, flights: Sequence[FlightNumbers]) -> Array:
        """Compute how much more agile each is flown than the reference, a logarithm, shape (flight,); 0 if unknown."""
        more = _logarithms(flights) - self.agility
        return np.where(np.isfinite(more), more, 0.0)

    def turned_more(self, flights: Sequence[FlightNumbers]) -> Array:
        """Give what the torque against the air does to numbers of flights that turn unlike the reference.

        A standard deviation that all numbers of a flight have in common, shape (flight, number).
        """
        return np.outer([flight.turning - self.turning for flight in flights], self.by_turning)


def _logarithms(flights: Sequence[FlightNumbers]) -> Array:
    """Take the logarithm of how agile flights are flown: in hover gusts and noise make it."""
    return np.log(_CALM + np.array([flight.agility for flight in flights]))


def _measured(flights: Sequence[FlightNumbers], names: Sequence[str]) -> Array:
    """Average the variances of numbers over flights, shape (number,)."""
    return np.asarray(np.mean([[flight.errors[name] ** 2 for name in names] for flight in flights], axis=0))


def number_limits(freedom: Array, asked: int) -> Array:
    """Compute the deviations that some number of an unchanged vehicle exceeds at the rate of `EACH_TEST` at most.

    `freedom`, shape (number,): degrees of freedom of each; `asked`: how many means of flights all of them are asked of.
    """
    # Slow to load, and who reads a record computes nothing.
    from scipy.special import stdtrit

    return np.asarray(-stdtrit(freedom, EACH_TEST / (2 * asked * len(freedom))))


def furthest(deviations: Array, freedom: Array, asked: int) -> float:
    """Compute at most how probable it is that any number of so many means of unchanged flights is as far off.

    `deviations`: shape (..., number).
    """
    from scipy.special import stdtr

    return float(2 * asked * len(freedom) * stdtr(freedom, -np.abs(deviations)).min())


def either(*p_values: float) -> float:
    """Give the probability of what either of two tests says by chance."""
    return min(2 * min(p_values), 1.0)


def common_numbers(flights: Sequence[FlightNumbers]) -> tuple[str, ...]:
    """List the numbers that all flights have, in the order of the first."""
    return tuple(name for name in flights[0].values if all(name in flight.values for flight in flights))


def expected_covariance(flights: Sequence[FlightNumbers], names: Sequence[str], vehicle: VehicleSettings) -> Array:
    """Compute the covariance that is expected of flights before any of them is seen, shape (number, number)."""
    # Scatter of flights holds the error of each; what is usual from day to day is added.
    return usual_covariance(names, vehicle) + np.diag(_measured(flights, names))


def learned_covariance(apart: Array, freedom: float, expected: Array, names: Sequence[str]) -> tuple[Array, Array]:
    """Learn the covariance of flights from what is expected and what is seen, and degrees of freedom of each number.

    What is expected of a kind counts as six flights, at a scale that the numbers of the kind identify together.

    `apart`, shape (row, number): whose squares add up to the covariance, times the degrees of freedom that they have.
    """
    alike = _alike(names)
    seen, kinds = (apart.T @ apart) * alike, np.array(kinds_of(names))
    scale, left = np.ones((2, len(names)))
    for kind in dict.fromkeys(kinds):
        own = kinds == kind
        scale[own], left[own] = _scale(expected[np.ix_(own, own)], seen[np.ix_(own, own)], freedom)
    return (_DAYS * scale * expected + seen) / (_DAYS + freedom), left


def _scale(expected: Array, seen: Array, freedom: float) -> tuple[float, float]:
    """Estimate by how much numbers of a kind vary against what is expected, a ratio, and the remaining freedom.

    The posterior mean of its logarithm, by the marginal likelihood of what is seen where each covariance is drawn from
    an inverse Wishart distribution about that scale: numbers of a kind identify it together, and few flights hardly do.
    How unsure it is costs degrees of freedom, as the variance of a logarithm of chi-squared is two over these.

    `expected`: shape (number, number).
    `seen`, shape (number, number): sum of squares, of so many degrees of freedom.
    Reference: Gelman 2006, Prior distributions for variance parameters in hierarchical models.
    """
    logarithms = np.linspace(-4.0, 4.0, 81) * 2 * _SCALE_ERROR
    beyond = np.maximum(np.linalg.eigvals(np.linalg.solve(expected, seen)).real, 0.0)
    strength = _DAYS + len(beyond) - 1
    determinant = np.log(_DAYS * np.exp(logarithms)[:, None] + beyond).sum(axis=1)
    likely = 0.5 * (strength * len(beyond) * logarithms - (strength + freedom) * determinant)
    likely -= 0.5 * (logarithms / (2 * _SCALE_ERROR)) ** 2
    share = np.exp(likely - likely.max())
    share /= share.sum()
    mean = share @ logarithms
    counts = np.mean(_DAYS / (_DAYS + beyond * np.exp(-mean)))
    unsure = counts**2 * (share @ (logarithms - mean) ** 2)
    return float(np.exp(mean)), max(float(1 / (1 / (_DAYS + freedom) + 0.5 * unsure)), _FEWEST_LEFT)


def usual_covariance(names: Sequence[str], vehicle: VehicleSettings) -> Array:
    """Compute what numbers of a vehicle that nobody changed usually do from day to day, shape (number, number)."""
    kinds = [KINDS[name.split()[0]] for name in names]
    sensors = np.array([" ".join(name.split()[:-1]) for name in names])
    apart, together = np.array([kind.apart for kind in kinds]), np.array([kind.together for kind in kinds])
    covariance = np.diag(apart**2) + np.outer(together, together) * (sensors[:, None] == sensors)
    moved = _OFFSET_M * _of_shares(names, thrust_directions(vehicle).offset)
    return np.asarray(covariance + moved.T @ moved)


@dataclass(frozen=True)
class ThrustDirections:
    """What a change does to the logarithms of the rotors' shares of thrust in hover."""

    rotor: Array  # Shape (rotor, rotor): of each rotor that lacks a share of its thrust and drag, for a whole share.
    mass: Array  # Shape (rotor,): for a relative change of the mass.
    offset: Array  # Shape (2, rotor): of the centre of mass along x and y, per m.
    yaw: Array  # Shape (rotor,): of a torque about z, for as much as all rotors' drag.


def thrust_directions(vehicle: VehicleSettings) -> ThrustDirections:
    """Compute what changes do to the rotors' shares of thrust.

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
    return ThrustDirections(
        rotor=(inverse @ allocation @ np.diag(hover)).T / hover,
        mass=np.ones(len(hover)),
        offset=wanted @ inverse.T / hover,
        yaw=drag * inverse[:, 3] / hover,
    )


def _by_turning(names: Sequence[str], vehicle: VehicleSettings) -> Array:
    """Give what the torque against the air usually does to numbers of a vehicle that turns by 1 rad/s."""
    return _BY_TURNING * _of_shares(names, thrust_directions(vehicle).yaw)


def _of_shares(names: Sequence[str], of: Array) -> Array:
    """Give what shares of thrust do, shape (..., rotor), of numbers by name; 0 of others, shape (..., number)."""
    own = {f"thrust M{index + 1}": value for index, value in enumerate(np.moveaxis(of, -1, 0))}
    return np.stack([own.get(name, np.zeros(of.shape[:-1])) for name in names], axis=-1)


def kinds_of(names: Sequence[str]) -> list[str]:
    """Give the kind of each number."""
    return [name.split()[0] for name in names]


def _alike(names: Sequence[str]) -> BoolArray:
    """Mark the pairs of numbers of one kind, shape (number, number)."""
    kinds = np.array(kinds_of(names))
    return np.asarray(kinds[:, None] == kinds)


def _by_agility(
    flights: Sequence[FlightNumbers], names: Sequence[str], values: Array, noise: Array
) -> tuple[Array, Array, Array, float, float]:
    """Regress numbers on the logarithm of how agile flights are flown.

    Result `rows`, shape (row, number): residuals, and what the prior adds.
    Result `slope`, `prior`, shape (number,): and the variance of the slope before any flight.
    Result `agility`, `spread`: mean of the logarithm, and the sum of squares about it.
    """
    prior = np.array([KINDS[kind].agile ** 2 for kind in kinds_of(names)])
    more = _logarithms(flights)
    agility = float(more.mean())
    if not np.isfinite(agility):
        return values, np.zeros(len(names)), prior, agility, 0.0
    centred = more - agility
    spread = float(centred @ centred)
    slope = centred @ values / (spread + noise / prior)
    return np.vstack([values - np.outer(centred, slope), slope * np.sqrt(noise / prior)]), slope, prior, agility, spread


def _by_voltage(flights: Sequence[FlightNumbers], names: Sequence[str], values: Array) -> tuple[Array, Array, float]:
    """Regress numbers of commands on the logarithm of the voltage: powers, their errors, the reference's voltage.

    Loads of speeds that were measured need no voltage.
    """
    voltage, kinds = np.array([flight.voltage for flight in flights]), np.array(kinds_of(names))
    power, error = np.zeros(len(names)), np.zeros(len(names))
    if not np.isfinite(voltage).all():
        return power, error, float("nan")
    usual = float(np.exp(np.log(voltage).mean()))
    lower = np.log(voltage / usual)
    for kind, before in _BY_VOLTAGE.items():
        own = kinds == kind
        if own.any() and (kind != "thrust" or all(flight.commanded for flight in flights)):
            mean = values[:, own].mean(axis=1)
            noise = KINDS[kind].together ** 2 + KINDS[kind].apart ** 2 / own.sum()
            information = (lower**2).sum() / noise + 1 / _VOLTAGE_ERROR**2
            power[own] = ((lower * (mean - mean.mean())).sum() / noise + before / _VOLTAGE_ERROR**2) / information
            error[own] = information**-0.5
    return power, error, usual
