"""Numbers of flights that nobody flew: drawn as those of one vehicle from day to day."""

import numpy as np

from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.reference import usual_covariance
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
