"""Any content that a result allows comes back as it was written, labelled, and passes the check."""

import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli import store
from cpfls_cli.artifacts.gate import SCHEMA_VERSION, InputFile
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import parse_yaml, resolved_yaml, to_yaml
from cpfls_cli.stages.info import formats
from tests.builders.results import drawn
from tests.builders.studies import VEHICLE

names = st.text("abcdefghijklmnopqrstuvwxyz.-_ ", min_size=1, max_size=12)
words = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=12)


@st.composite
def origins(draw):
    inputs = {
        f"flight-{number}": InputFile(draw(names), draw(names), draw(names))
        for number in range(draw(st.integers(0, 2)))
    }
    return {"inputs": inputs, "seed": draw(st.integers(0, 2**63 - 1) | st.none()), "config": draw(words)}


@pytest.mark.parametrize("stage", formats(), ids=lambda stage: stage.name)
@settings(max_examples=2, deadline=None)
@given(st.integers(0, 2**32 - 1), origins())
def test_round_trip(stage, seed, origin):
    kind, origin = stage.kind, store.Origin(stage=stage.name, **origin)
    made = drawn(kind, np.random.default_rng(seed))
    assert store.findings(made) == []
    with tempfile.TemporaryDirectory() as folder:
        path, again = Path(folder, "a.h5"), Path(folder, "b.h5")
        store.write(path, made, origin)
        assert store.findings_in(path, kind) == []
        assert (store.format_name(path), store.read_origin(path)) == (kind.FORMAT, origin)
        read, from_file = store.read(path, kind)
        assert from_file == origin
        store.write(again, read, from_file)
        assert again.read_bytes() == path.read_bytes()
        _describes_itself(path, kind, origin)


def _describes_itself(path, kind, origin):
    held = store.flat(path)
    with h5py.File(path) as file:
        assert (file.attrs["format"], file.attrs["schema_version"]) == (kind.FORMAT, SCHEMA_VERSION)
        assert (file.attrs["cpfls_version"], file.attrs["stage"]) == (origin.version, origin.stage)
        assert (file.attrs.get("seed"), set(file.get("inputs", {}))) == (origin.seed, set(origin.inputs))
        for name, (about, values) in held.items():
            attributes = file[name].attrs
            assert (attributes["units"], attributes["frame"]) == (about.units, about.frame)
            assert attributes["description"] == about.description != ""
            assert len(about.dimensions) == values.ndim
            assert all(about.dimensions)


printable = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cn", "Co"]))
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | printable,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(printable, inner, max_size=4),
    max_leaves=12,
)
numbers = st.from_regex(r"[-+]?[0-9_.:xeE]{1,8}", fullmatch=True)


@given(plain)
def test_plain_data(data):
    assert parse_yaml(to_yaml(data), "file") == data


@given(numbers)
def test_text_like_numbers(text):
    assert parse_yaml(to_yaml([text]), "file") == [text]


@given(
    title=printable | numbers,
    mass=st.floats(3.0, 12.0),
    seed=st.integers(0, 2**63 - 1),
    sections=st.sets(st.sampled_from(["vehicle", "reduction", "import", "identification"])),
)
def test_study(title, mass, seed, sections):
    vehicle = parse_yaml(VEHICLE, "usual")["vehicle"] | {"mass_kg": mass}
    data = {"seed": seed, "vehicle": vehicle, "report": {"title": title}}
    study = validate(data | dict.fromkeys(sections - {"vehicle"}), "file")
    again = validate(parse_config(resolved_yaml(study), "file"), "file")
    assert again == study
    assert (again.seed, again.vehicle.mass_kg, again.report.title) == (seed, mass, title)
