"""Flights with the centre of mass off, and what `cpfls gap` finds in them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from tests.builders.shifted_flights import CONFIG, HEADER, OFFSET, attitude_of, flight_table, motion, save
from tests.builders.studies import VEHICLE, put_file


@pytest.fixture(scope="session")
def gap_config(tmp_path_factory):
    return put_file(tmp_path_factory.mktemp("gap-config") / "study.yaml", CONFIG + VEHICLE)


@pytest.fixture(scope="session")
def shifted(tmp_path_factory):
    """Three flights with the centre of mass off."""
    folder = tmp_path_factory.mktemp("shifted")
    return [save(folder / f"flight_{n}.csv", flight_table(n, OFFSET)) for n in (1, 2, 3)]


@pytest.fixture(scope="session")
def offset_answer(cpfls, gap_config, shifted, tmp_path_factory):
    """The folder that `cpfls gap` fills from these flights, what it says and its summary; nobody writes into it."""
    folder = tmp_path_factory.mktemp("found") / "gap"
    stdout = cpfls.done("gap", gap_config, *shifted, "-o", folder, "-v").stdout
    return SimpleNamespace(folder=folder, stdout=stdout, summary=json.loads((folder / "gap.json").read_text()))


@pytest.fixture(scope="session")
def extended(offset_answer):
    """The vehicle with the centre of mass where it was found."""
    return offset_answer.folder / "extended.h5"


@pytest.fixture(scope="session")
def exact(tmp_path_factory):
    """Two flights of the vehicle as it is."""
    folder = tmp_path_factory.mktemp("exact")
    return [save(folder / f"flight_{n}.csv", flight_table(n)) for n in (1, 2)]


@pytest.fixture(scope="session")
def with_attitude(tmp_path_factory):
    """Two flights with the centre of mass off and a measured attitude."""
    folder = tmp_path_factory.mktemp("with-attitude")
    paths = []
    for number in (4, 5):
        table = flight_table(number, OFFSET)
        rate, _, _ = motion(table[:, 0], np.random.default_rng(number))
        noise = np.random.default_rng(number).normal(0, 0.002, (len(table), 3))
        logged = np.column_stack([table, attitude_of(rate) + noise])
        paths.append(save(folder / f"flight_{number}.csv", logged, HEADER + ",phi,theta,psi"))
    return paths
