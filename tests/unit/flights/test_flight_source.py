"""A flight that stays in its file: whoever reads it must find the very file that was opened."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.artifacts.flight import MOTION, FlightRecord
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.store import write_record
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.errors import InputError
from cpfls_cli.files import seal_of
from cpfls_cli.flights import flight_source as sources

SAMPLES = 30


def write(path, samples):
    rng = np.random.default_rng(2)
    signals = {name: rng.normal(size=(samples, 3)) for name in (*MOTION, "torque")}
    header = Header("1", 1, resolved_yaml(Study()))
    write_record(path, FlightRecord(header=header, time=np.arange(samples) / 10, **signals))


@pytest.fixture
def source(tmp_path, monkeypatch):
    """As a worker gets it: pickled here, and read there."""
    monkeypatch.setattr(sources, "IN_MEMORY", 10)
    write(tmp_path / "flight.h5", SAMPLES)
    opened = sources.part_of(sources.flight_source(tmp_path / "flight.h5"), slice(5, 20))
    return pickle.loads(pickle.dumps(opened))


def test_it_is_read_where_the_same_file_lies(source):
    assert source.path.is_absolute()
    (part,) = source.chunks()
    np.testing.assert_array_equal(part.time, np.arange(5, 20) / 10)


def another_size(path):
    path.write_bytes(path.read_bytes() + b"x")


def another_length(path):
    size, sealed = path.stat().st_size, len(seal_of(b""))
    write(path, SAMPLES - 3)
    content = path.read_bytes()[:-sealed].ljust(size - sealed, b"\0")
    path.write_bytes(content + seal_of(content))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (Path.unlink, "no such file"),
        (another_size, "another file, of [0-9]+ bytes instead of"),
        (another_length, "another file, with 27 samples instead of 30"),
    ],
)
def test_another_file_is_refused_with_path_and_remedy(source, change, said):
    change(source.path)
    with pytest.raises(InputError, match=f"{source.path}: {said}.*put the same file there on each"):
        next(source.chunks())
