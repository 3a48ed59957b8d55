"""A prediction written part by part is the prediction written whole: one file, the same findings, little space."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from cpfls_cli.artifacts import spec, store
from cpfls_cli.artifacts.prediction import Findings, PredictionRecord
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.errors import ComputationError

# No multiple of a part.
SAMPLES = 2 * spec.PART + 100
HEADER = Header("1.2.3", 4, "seed: 4\n")


@pytest.fixture(scope="module")
def whole():
    rng = np.random.default_rng(1)
    attitude, torque, error = rng.normal(size=(3, SAMPLES, 3))
    matrix = np.broadcast_to(np.eye(3), (SAMPLES, 3, 3)).copy()
    matrix[5] *= -1.0
    return PredictionRecord(
        header=HEADER,
        time=np.arange(SAMPLES) / 100,
        attitude=attitude,
        torque=torque,
        body_torque=torque,
        measured_torque=torque + error,
        error=error,
        held_against="motion",
        force=torque,
        measured_force=torque + 2.0,
        inertia=matrix,
        coriolis=matrix,
        outside=np.arange(SAMPLES) % 2 == 0,
    )


def parts_of(whole):
    for start in range(0, SAMPLES, spec.PART):
        own = {name: value for name, value in vars(whole).items() if isinstance(value, np.ndarray)}
        yield replace(whole, **{name: value[start : start + spec.PART] for name, value in own.items()})


def test_parts_make_the_file_of_the_whole(whole, tmp_path):
    store.write_record(tmp_path / "whole.h5", whole)
    store.write_parts(tmp_path / "parts.h5", parts_of(whole), SAMPLES)
    assert (tmp_path / "parts.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()
    read = store.read_record(tmp_path / "parts.h5", PredictionRecord)
    for name, values in whole.data.items():
        np.testing.assert_array_equal(read.data[name], values)


def test_what_has_a_value_for_each_sample_is_compressed(whole, tmp_path):
    store.write_record(tmp_path / "whole.h5", whole)
    with h5py.File(tmp_path / "whole.h5") as file:
        assert {file[name].compression for name in whole.data if name != "held_against"} == {"gzip"}
        assert file["torque"].shuffle
        assert file["held_against"].compression is None


@pytest.mark.parametrize("bad", [3, SAMPLES - 1])
def test_a_result_that_is_no_number_is_not_written(whole, tmp_path, bad):
    torque = whole.torque.copy()
    torque[bad] = np.nan
    said = f"p.h5: not written: torque: 1 samples are not finite, the first at index {bad}$"
    with pytest.raises(ComputationError, match=said):
        store.write_parts(tmp_path / "p.h5", parts_of(replace(whole, torque=torque)), SAMPLES)
    assert list(tmp_path.iterdir()) == []


def test_findings_of_parts_are_those_of_the_whole(whole):
    found = Findings()
    for part in parts_of(whole):
        found.add(part)
    assert found.summary == whole.findings.summary
    assert (found.samples, found.outside, found.not_positive_definite) == (SAMPLES, (SAMPLES + 1) // 2, 1)
    np.testing.assert_allclose(found.force_rms, 2.0)
    np.testing.assert_allclose(found.score.mse, np.mean(whole.error**2, axis=0))
