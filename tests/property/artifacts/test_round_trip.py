"""Any content that a format allows comes back as it was written, labelled, and passes the check."""

import hashlib
import tempfile
from pathlib import Path

import h5py
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.formats import records
from cpfls_cli.artifacts.spec import SCHEMA_VERSION, Header, InputFile
from cpfls_cli.artifacts.store import Artifact, file_sha256, read_artifact, write_artifact

FIXED = {"axis": 3}
# HDF5 pads text of fixed length with zero bytes, so text cannot end in one; files hold no other control characters.
words = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=12)
names = st.text("abcdefghijklmnopqrstuvwxyz.-_ ", min_size=1, max_size=12)


@st.composite
def artifacts(draw):
    record = draw(st.sampled_from(records()))
    spec = record.spec()
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    labels = {label for dataset in spec.datasets for label in dataset.dimensions if not label.isdigit()}
    lengths = {label: FIXED.get(label) or draw(st.integers(0, 5), label) for label in sorted(labels)}
    # A path has two samples at least.
    lengths |= {
        label: 2 + lengths[label] for dataset in spec.datasets if dataset.path == "time" for label in dataset.dimensions
    }
    # An index needs something to lead to.
    lengths |= {dataset.dimensions[0]: 1 + lengths[dataset.dimensions[0]] for dataset in spec.datasets if dataset.holds}
    lengths |= {dataset.into: 1 + lengths[dataset.into] for dataset in spec.datasets if dataset.into in lengths}
    whole = {}
    for dataset in spec.datasets:
        shape = tuple(int(label) if label.isdigit() else lengths[label] for label in dataset.dimensions)
        if dataset.units == "text":
            size = int(np.prod(shape, dtype=int))
            whole[dataset.path] = np.array(draw(st.lists(words, min_size=size, max_size=size)), dtype="U").reshape(
                shape
            )
            if dataset.holds:
                whole[dataset.path] = np.append(whole[dataset.path][1:], dataset.holds)
        elif dataset.path == "time":
            whole[dataset.path] = np.cumsum(rng.uniform(0.1, 1.0, shape))
        else:
            whole[dataset.path] = rng.normal(size=shape)
            if dataset.into in lengths:
                whole[dataset.path] = rng.integers(0, lengths[dataset.into], shape)
            whole[dataset.path] = np.maximum(whole[dataset.path], dataset.least)
            if dataset.gaps and whole[dataset.path].size:
                whole[dataset.path] = np.where(rng.random(shape) < 0.5, np.nan, whole[dataset.path])
    optional = [dataset.path for dataset in spec.datasets if not dataset.required]
    data = {name: values for name, values in whole.items() if name not in optional or draw(st.booleans())}
    # A group is there whole or not at all.
    while lacking := record.lacking(data):
        data |= {name: whole[name] for name in lacking}
    inputs = {role: InputFile(draw(names), draw(names), draw(names)) for role in spec.inputs if draw(st.booleans())}
    header = Header(draw(names), draw(st.integers(0, 2**63 - 1)), draw(words) + "\n", inputs)
    return Artifact(spec, header, data)


@settings(max_examples=60, deadline=None)
@given(artifacts())
def test_round_trip(artifact):
    with tempfile.TemporaryDirectory() as folder:
        path, again = Path(folder, "a.h5"), Path(folder, "b.h5")
        write_artifact(path, artifact)
        read = read_artifact(path, artifact.spec)
        assert read.header == artifact.header
        assert set(read.data) == set(artifact.data)
        for name, values in artifact.data.items():
            np.testing.assert_array_equal(read.data[name], values, err_msg=name)
        assert check_artifact(read) == []
        write_artifact(again, read)
        assert file_sha256(again) == file_sha256(path)
        _describes_itself(path, artifact)


def _describes_itself(path, artifact):
    with h5py.File(path) as file:
        assert file.attrs["format"] == artifact.spec.name
        assert file.attrs["schema_version"] == SCHEMA_VERSION
        assert file.attrs.get("kind", "") == artifact.spec.kind
        assert file.attrs["cpfls_version"] == artifact.header.version
        assert file.attrs["seed"] == artifact.header.seed
        assert file.attrs["config_sha256"] == hashlib.sha256(bytes(file["config"][()])).hexdigest()
        assert set(file.get("inputs", {})) == set(artifact.header.inputs)
        for name in artifact.data:
            spec = artifact.spec.dataset(name)
            attributes = file[name].attrs
            assert (attributes["units"], attributes["frame"]) == (spec.units, spec.frame)
            assert attributes["description"] == spec.description
            assert tuple(dimension.label for dimension in file[name].dims) == spec.dimensions
