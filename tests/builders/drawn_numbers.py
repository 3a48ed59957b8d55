"""Numbers of flights that nobody flew: drawn as those of one vehicle from day to day."""

from dataclasses import replace

import numpy as np

from cpfls_cli.changes.judge import changed
from cpfls_cli.changes.numbers import FlightNumbers, numbers_of
from cpfls_cli.changes.reference import usual_covariance
from cpfls_cli.changes.trend import trend
from cpfls_cli.config.load import parse_config, validate
from tests.builders.studies import VEHICLE

QUAD = validate(parse_config(VEHICLE, "drawn"), "drawn").vehicle
NAMES = (
    *(f"thrust M{index}" for index in range(1, 5)),
    *(f"vibration gyroscope {axis}" for axis in "xyz"),
    *(f"delay {axis}" for axis in ("roll", "pitch", "yaw")),
)
DEVIATION = np.sqrt(np.diag(usual_covariance(NAMES, QUAD)))
"""Of each number from day to day."""


def flights(count, rng, change=None, since=0, scatter=1.0, voltage=np.nan):
    """Draw flights of which those from one on have a change in their numbers."""
    root = np.linalg.cholesky(usual_covariance(NAMES, QUAD))
    drawn = scatter * rng.normal(size=(count, len(NAMES))) @ root.T
    if change is not None:
        drawn[since:] += change
    return [
        flight_of(f"flight{index + 1}", dict(zip(NAMES, row, strict=True)), voltage)
        for index, row in enumerate(drawn.tolist())
    ]


def flight_of(name, values, voltage=np.nan):
    """Arrange numbers of a flight that are known exactly."""
    numbers = numbers_of(values, dict.fromkeys(values, 0.0))
    return FlightNumbers(name=name, numbers=numbers, voltage=voltage, duration_s=20.0, commanded=True)


def having(flight, values, **more):
    """Give a flight other numbers."""
    return replace(flight, numbers=numbers_of(values, dict.fromkeys(values, 0.0)), **more)


def drawn_trend():
    """Find the trend of twenty flights, one a day, the last eight of which have a weak rotor; one is left out."""
    rng = np.random.default_rng(1)
    row = flights(20, rng, 0.25 * (np.arange(len(NAMES)) == 2), since=12)
    dated = [replace(own, flown_at_s=1.7e9 + 86400.0 * day) for day, own in enumerate(row)]
    return replace(trend(dated, QUAD, rng), order="date", warnings=("left out, 1 flight: a.csv",))


def drawn_changed(**more):
    """Find what changed of a flight whose third rotor pulls less, against four that are as ever; with other fields."""
    rng = np.random.default_rng(2)
    (today,) = flights(1, rng, 0.35 * (np.arange(len(NAMES)) == 2))
    return replace(changed([replace(today, name="today.csv")], flights(4, rng), QUAD, rng), **more)
