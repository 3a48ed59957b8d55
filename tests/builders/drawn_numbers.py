"""Numbers of flights that nobody flew: drawn as those of one vehicle from day to day."""

import numpy as np

from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.trend import TrendRecord
from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.reference import usual_covariance
from cpfls_cli.changes.trend import trend
from cpfls_cli.commands.changed import units_of
from cpfls_cli.config.load import parse_config, validate
from tests.builders.studies import VEHICLE

QUAD = validate(parse_config(VEHICLE, "drawn"), "drawn").vehicle
NAMES = (
    *(f"load M{index}" for index in range(1, 5)),
    *(f"vibration gyroscope {axis}" for axis in "xyz"),
    *(f"late {axis}" for axis in ("roll", "pitch", "yaw")),
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
        FlightNumbers(
            f"flight{index + 1}", dict(zip(NAMES, row, strict=True)), dict.fromkeys(NAMES, 0.0), voltage, 20.0, True
        )
        for index, row in enumerate(drawn.tolist())
    ]


def trend_record():
    """Arrange twenty flights, one a day, the last eight of which have a weak rotor, and one of which is left out."""
    rng = np.random.default_rng(1)
    row = flights(20, rng, 0.25 * (np.arange(len(NAMES)) == 2), since=12)
    found = trend(row, QUAD, rng)
    dates = [1.7e9 + 86400.0 * day for day in range(20)]
    made = TrendRecord.of(
        found,
        dates,
        "date",
        units_of(found.names, QUAD),
        ["left out, 1 flight: a.csv"],
        [],
        false_alarm=0.01,
        named_from=0.9,
    )
    return made.with_header(Header("0", 1, VEHICLE))
