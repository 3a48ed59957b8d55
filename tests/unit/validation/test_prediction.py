"""A prediction written part by part is the prediction written whole: one file, the same findings, little space."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts import spec
from cpfls_cli.errors import ComputationError
from cpfls_cli.result import described_fields
from cpfls_cli.validation.prediction import AlongFlight, Totals

# No multiple of a part.
SAMPLES = 2 * spec.PART + 100
ORIGIN = store.Origin(stage="predict", seed=4, config="seed: 4\n")


@pytest.fixture(scope="module")
def whole():
    rng = np.random.default_rng(1)
    attitude, torque, error = rng.normal(size=(3, SAMPLES, 3))
    matrix = np.broadcast_to(np.eye(3), (SAMPLES, 3, 3)).copy()
    matrix[5] *= -1.0
    return AlongFlight(
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
        extrapolates=np.arange(SAMPLES) % 2 == 0,
    )


ALONG = [own.name for own in described_fields(AlongFlight) if own.about.axes[:1] == ("time",)]


def parts_of(whole):
    """The whole in parts, each with what is known until there."""
    totals = Totals()
    for start in range(0, SAMPLES, spec.PART):
        yield totals.with_next(whole.part(slice(start, start + spec.PART)))


def write_parts(path, whole):
    store.write_parts(path, parts_of(whole), SAMPLES, ORIGIN)


def test_parts_make_the_file_of_the_whole(whole, tmp_path):
    *_, last = parts_of(whole)
    found = {own.name: getattr(last, own.name) for own in described_fields(AlongFlight) if own.name not in ALONG}
    store.write(tmp_path / "whole.h5", replace(whole, **found), ORIGIN)
    write_parts(tmp_path / "parts.h5", whole)
    assert (tmp_path / "parts.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()
    read, _ = store.read(tmp_path / "parts.h5", AlongFlight)
    for name in ALONG:
        if getattr(whole, name) is not None:
            np.testing.assert_array_equal(getattr(read, name), getattr(whole, name))


def test_what_has_a_value_for_each_sample_is_compressed(whole, tmp_path):
    write_parts(tmp_path / "whole.h5", whole)
    with h5py.File(tmp_path / "whole.h5") as file:
        assert {file[name].compression for name in ALONG if name in file} == {"gzip"}
        assert file["torque"].shuffle
        assert file["held_against"].compression is None


@pytest.mark.parametrize("bad", [3, SAMPLES - 1])
def test_a_result_that_is_no_number_is_not_written(whole, tmp_path, bad):
    torque = whole.torque.copy()
    torque[bad] = np.nan
    with pytest.raises(ComputationError, match=r"p.h5: not written: torque: \d of \d+ values are not finite"):
        write_parts(tmp_path / "p.h5", replace(whole, torque=torque))
    assert list(tmp_path.iterdir()) == []


def test_what_is_found_in_parts_is_what_is_found_in_the_whole(whole):
    *_, last = parts_of(whole)
    once = Totals().with_next(whole)
    for own in described_fields(AlongFlight):
        value = getattr(once, own.name)
        if own.name not in ALONG and not isinstance(value, str | tuple | None):
            np.testing.assert_allclose(getattr(last, own.name), value, rtol=1e-12)
    assert (last.samples, last.outside, last.not_positive_definite) == (SAMPLES, (SAMPLES + 1) // 2, 1)
    np.testing.assert_allclose(last.force_rms, 2.0)
