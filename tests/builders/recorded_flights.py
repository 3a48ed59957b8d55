"""Flights of other people, in the folder that `CPFLS_FLIGHTS` names; a test of one that is absent is skipped."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

FLIGHTS = Path(os.environ.get("CPFLS_FLIGHTS", "../shared/data"))


def path_of_log(folder, name):
    """Give the path of a log, or skip the test."""
    # What a Crazyflie writes on its card has no ending.
    path = FLIGHTS / folder / name
    path = path if path.is_file() else path.with_name(f"{name}.csv")
    if not path.exists():
        pytest.skip(f"{path} is absent; set CPFLS_FLIGHTS to the folder of other people's flights")
    return path


def columns_of_log(folder, name):
    """Read the columns of a log by name, or skip the test."""
    with path_of_log(folder, name).open() as stream:
        header, *rows = csv.reader(stream)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))
