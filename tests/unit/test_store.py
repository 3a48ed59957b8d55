"""Results in files."""

import dataclasses
from typing import ClassVar

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.files import seal_of
from cpfls_cli.result import about, part, plain, result
from tests.builders.results import Craft, craft, estimate

ORIGIN = store.Origin(
    inputs={"log": InputFile("a.bbl", "0" * 64, "bbl")}, seed=3, config="seed: 3\n", cautions=("one", "two")
)


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "craft.h5"
    store.write(path, craft(), ORIGIN)
    return path


def changed(path, change):
    """Change a file as another program would, and seal it again."""
    with h5py.File(path, "r+") as file:
        change(file)
    content = path.read_bytes()
    path.write_bytes(content + seal_of(content))


def flat(given):
    """Everything that a result holds, arrays as lists."""
    if dataclasses.is_dataclass(given):
        return {each.name: flat(getattr(given, each.name)) for each in dataclasses.fields(given)}
    if isinstance(given, dict):
        return [(name, flat(each)) for name, each in given.items()]
    if isinstance(given, tuple):
        return tuple(map(flat, given))
    return (given.dtype.str, np.nan_to_num(given, nan=-9.0).tolist()) if isinstance(given, np.ndarray) else given


def test_what_is_written_is_read(written):
    given, origin = store.read(written, Craft)
    assert origin == ORIGIN
    assert repr(flat(given)) == repr(flat(craft()))


def test_tables_may_be_empty_and_seed_and_config_missing(tmp_path):
    own = craft(
        rotors=(), curves={}, notes=(), order=np.zeros(0, int), marked=np.zeros(0, bool), hover=None, battery="4S"
    )
    store.write(tmp_path / "a.h5", own, store.Origin())
    given, origin = store.read(tmp_path / "a.h5", Craft)
    assert repr(flat(given)) == repr(flat(own))
    assert (origin.seed, origin.config, origin.cautions) == (None, "", ())


def test_equal_content_is_an_equal_file(written, tmp_path):
    again = tmp_path / "again.h5"
    store.write(again, *store.read(written, Craft))
    assert again.read_bytes() == written.read_bytes()


def test_any_reader_sees_what_each_dataset_is(written):
    with h5py.File(written) as file:
        assert dict(file.attrs) | {"cpfls_version": ""} == {
            "format": "cpfls/craft",
            "schema_version": 2,
            "cpfls_version": "",
            "seed": 3,
            "cautions": "one\ntwo",
        }
        assert dict(file["mass"].attrs) == {"units": "kg", "frame": "none", "description": "as it flew"}
        assert [each.label for each in file["rotors/place"].dims] == ["rotors", "2"]
        assert file["rotors/share/value"][()].tolist() == [0.2, 0.3]
        assert file["rotors/peaks/row"][()].tolist() == [1, 1]
        assert file["curves/roll/gain"].dims[1].label == "axis"


def test_single_precision_stays_and_what_is_large_is_compressed(tmp_path):
    @result
    class Long:
        """Many samples."""

        FORMAT: ClassVar = "cpfls/long"
        values: np.typing.NDArray[np.float32] = about("samples", "sample")

    values = np.arange(100_000, dtype=np.float32)
    store.write(tmp_path / "a.h5", Long(values=values), store.Origin())
    given, _ = store.read(tmp_path / "a.h5", Long)
    assert given.values.dtype == np.float32
    assert np.array_equal(given.values, values)
    assert (tmp_path / "a.h5").stat().st_size < 0.5 * values.nbytes


def test_what_breaks_its_description_is_not_written_and_all_of_it_is_said(tmp_path):
    rotors = craft().rotors
    wrong = craft(
        mass=-1.0,
        flights=2.5,
        order=np.arange(3),
        name=None,
        rotors=(rotors[0], dataclasses.replace(rotors[1], share=estimate(1.0), place=np.zeros(3))),
        curves={"a/b": craft().curves["roll"]},
    )
    path = tmp_path / "a.h5"
    with pytest.raises(ComputationError) as error:
        store.write(path, wrong, ORIGIN)
    assert str(error.value).splitlines() == [
        f"{path}: not written: name: is missing",
        f"{path}: not written: mass: is below 0",
        f"{path}: not written: flights: holds float64, expected int",
        f"{path}: not written: marked: 2 along 'rotor', but 3 by order",
        f"{path}: not written: rotors/1/place: 3 along '2', but 2 by its description",
        f"{path}: not written: curves: 'a/b' cannot be the name of a part",
    ]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("own", "finding"),
    [
        ({"mass": np.inf}, "mass: 1 of 1 values are not finite"),
        ({"mass": "1"}, "mass: holds <U1, expected float"),
        ({"notes": ("a", 1.0)[1:]}, "notes: holds float64, expected str"),
        ({"order": np.zeros((2, 2), int)}, "order: has 2 axes, expected 1 ('rotor',)"),
    ],
)
def test_findings(own, finding):
    assert store.findings(craft(**own)) == [finding]


def test_an_axis_of_a_result_has_its_length_in_its_parts():
    @result
    class Inner:
        """A part."""

        gain: np.typing.NDArray[np.float64] = about("by frequency", "frequency")

    @result
    class Outer:
        """A whole."""

        inner: Inner = part()
        frequency: np.typing.NDArray[np.float64] = about("of all", "frequency")

    wrong = Outer(inner=Inner(gain=np.zeros(3)), frequency=np.zeros(2))
    assert store.findings(wrong) == ["inner/gain: 3 along 'frequency', but 2 by frequency"]


def test_all_that_is_missing_is_said_once(written):
    def without(file):
        del file["mass"], file["rotors/share/low"], file["curves"], file["hover"], file["kind"]

    changed(written, without)
    with pytest.raises(InputError) as error:
        store.read(written, Craft)
    assert str(error.value) == f"{written}: the cpfls/craft lacks /mass, /rotors/share/low, /curves; make it again"


def test_what_has_a_default_may_be_missing(written):
    def without(file):
        del file["kind"], file["hover"], file["rotors/lag"]

    changed(written, without)
    given, _ = store.read(written, Craft)
    assert (given.kind, given.hover, given.rotors[1].lag) == ("cross", None, None)


def test_what_breaks_its_description_is_not_read(written):
    def spoil(file):
        file["mass"][()] = -1.0
        file["rotors/share/value"][0] = np.nan

    changed(written, spoil)
    with pytest.raises(InputError) as error:
        store.read(written, Craft)
    assert str(error.value) == f"{written}: mass: is below 0"
    assert store.examine(written, Craft)[2] == ["mass: is below 0"]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda file: file["rotors"].attrs.update(rows=3),
        lambda file: file["rotors/peaks"].attrs.update(rows=10**12),
        lambda file: file["rotors/peaks"].attrs.update(rows=-1),
        lambda file: file["rotors/peaks/row"].write_direct(np.array([0, 7], np.int64)),
        lambda file: file.__delitem__("name") or file.create_dataset("name", data=1.0),
        lambda file: file.__delitem__("name") or file.create_group("name"),
        lambda file: file.__delitem__("curves") or file.create_dataset("curves", data=1.0),
        lambda file: file.__delitem__("order") or file.create_dataset("order", (10**9,), "i8", chunks=True),
    ],
)
def test_a_damaged_file_ends_in_one_sentence(written, spoil):
    changed(written, spoil)
    with pytest.raises(InputError, match="damaged: "):
        store.read(written, Craft)


def test_other_files_are_refused(written, tmp_path):
    other = type("Other", (Craft,), {"FORMAT": "cpfls/other"})
    with pytest.raises(InputError, match=r"is a cpfls/craft; this command needs a cpfls/other"):
        store.read(written, other)
    written.write_bytes(written.read_bytes()[:-200])
    with pytest.raises(InputError, match="checksum"):
        store.read(written, Craft)
    assert store.stage_of(written) == store.stage_of(tmp_path / "none") == ""


def test_json_is_the_same_after_reading(written):
    assert plain(store.read(written, Craft)[0]) == plain(craft())
