"""Results describe themselves, and are stored whole or not at all."""

import dataclasses
import json
from typing import ClassVar

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.consistency.check import Audit
from cpfls_cli.consistency.findings import AuditFinding, FaultNumber
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.files import seal_of
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.result import Estimate, about, column, datasets, described_fields, part, plain, result
from tests.builders import exported_models
from tests.builders.results import Craft, Curve, Rotor, craft, estimate
from tests.builders.vehicle_models import whole, wrench_somewhere

ORIGIN = store.Origin(
    stage="look",
    inputs={"log": InputFile("a.bbl", "0" * 64, "bbl")},
    seed=3,
    config="seed: 3\n",
    cautions=("one", "two"),
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
    store.write(tmp_path / "a.h5", own, store.Origin(stage="look"))
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
            "format": "cpfls/craft", "stage": "look", "schema_version": 4, "cpfls_version": "", "seed": 3,
            "cautions": "one\ntwo",
        }  # fmt: skip
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
    store.write(tmp_path / "a.h5", Long(values=values), store.Origin(stage="look"))
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


@result
class Track:
    """A long track."""

    FORMAT: ClassVar = "cpfls/track"
    STREAMED: ClassVar = "time"

    time: np.ndarray = about("time", "time", unit="s", ascends=True)
    place: np.ndarray = about("place", "time", "axis", unit="m")
    wind: np.ndarray | None = about("wind", "time", default=None)
    name: str = about("who flew")


def track(samples, start=0, **more):
    time = np.arange(start, start + samples) * 0.01
    return Track(time=time, place=np.outer(time, [1.0, 2.0, 3.0]), name="Ann", **more)


def test_parts_of_a_long_result_are_the_bytes_of_the_whole(tmp_path):
    whole, parts = tmp_path / "whole.h5", tmp_path / "parts.h5"
    store.write(whole, track(20_000), ORIGIN)
    store.write_parts(parts, (track(min(8192, 20_000 - at), at) for at in range(0, 20_000, 8192)), 20_000, ORIGIN)
    assert whole.read_bytes() == parts.read_bytes()
    given, _ = store.read(parts, Track)
    assert np.array_equal(given.place, track(20_000).place)
    store.write(whole, track(8193), ORIGIN)
    assert len(store.read(whole, Track)[0].time) == 8193


def test_a_part_that_breaks_its_description_is_not_written(tmp_path):
    path = tmp_path / "parts.h5"
    with pytest.raises(ComputationError, match="time: does not ascend at index 100, in rows from 0"):
        store.write_parts(path, iter([track(100), track(100)]), 200, ORIGIN)
    assert not path.exists()


def test_rows_are_read_some_at_a_time(tmp_path):
    path = tmp_path / "track.h5"
    store.write(path, track(1000), ORIGIN)
    assert store.count_rows(path, Track, "time") == 1000
    assert store.count_rows(path, Track, "wind") is store.count_rows(path, Craft, "time") is None
    assert store.held_rows(path, Track) == ["time", "place"]
    store.check_rows(path, Track, ["time", "place"])
    times, places = zip(*store.read_rows(path, ["time", "place"], 100, 350, 100), strict=True)
    assert [len(each) for each in times] == [100, 100, 50]
    assert np.array_equal(np.concatenate(places), track(1000).place[100:350])
    with pytest.raises(InputError, match="lacks wind"):
        store.check_rows(path, Track, ["wind"])


def test_rows_that_break_their_description_are_found_without_reading_all(tmp_path):
    path = tmp_path / "track.h5"
    store.write(path, track(600_000), ORIGIN)

    def spoil(file):
        file["time"][300_000] = 0.0
        file["place"][500_000] = np.inf

    changed(path, spoil)
    with pytest.raises(InputError) as error:
        store.check_rows(path, Track, ["time", "place"])
    assert [line.partition(": ")[2] for line in str(error.value).splitlines()] == [
        "time: does not ascend at index 37857, in rows from 262144",
        "place: 3 of 786432 values are not finite, in rows from 262144",
    ]


@pytest.mark.parametrize(
    ("own", "finding"),
    [
        (track(1), "time: holds 1 samples; at least two are needed"),
        (dataclasses.replace(track(3), time=np.array([0.0, 2.0, 2.0])), "time: does not ascend at index 2"),
        (dataclasses.replace(track(3), place=np.full((3, 3), 1e200)), "place: holds values beyond 1e+150"),
    ],
)
def test_findings_of_time_and_of_size(own, finding):
    assert finding in store.findings(own)


@result
class Flown:
    """A model of a vehicle with all its parts: named tuples, settings, values by name, arrays of several lengths."""

    FORMAT: ClassVar = "cpfls/look"

    model: VehicleModel = part()


@pytest.mark.parametrize("name", ["cpfls", "zero width, classic"])
def test_a_model_of_a_vehicle_is_written_with_all_its_parts(tmp_path, name):
    fault = AuditFinding("gyro_bias", (FaultNumber("b_x", 0.1, "rad/s", 0.0, 0.2, True),), 0.01, True, "biased")
    audit = Audit((fault, AuditFinding("gyro_scale", (), 1.0, False, "")), {"a": "no attitude"}, (), ("late",))
    fuzzy = exported_models.model_of(exported_models.CASES.get(name, next(iter(exported_models.CASES.values()))))
    sag = ModelEffect("battery_sag", {"exponent": 1.5}, np.zeros(0))
    model = whole(fuzzy=fuzzy, repairs=audit, gusts=Gusts(np.ones(6), np.full(6, 0.5)), hold="linear", commanded=True)
    model = dataclasses.replace(model, effects=(*model.effects, sag))
    store.write(tmp_path / "m.h5", Flown(model=model), ORIGIN)
    given = store.read(tmp_path / "m.h5", Flown)[0].model
    assert (given.vehicle, given.response, given.wind) == (model.vehicle, model.response, model.wind)
    assert all(np.array_equal(*pair) for pair in zip(wrench_somewhere(given), wrench_somewhere(model), strict=True))
    assert [(each.name, each.shape) for each in given.effects] == [(each.name, each.shape) for each in model.effects]
    assert (given.fuzzy.structure, given.fuzzy.ranges) == (fuzzy.structure, fuzzy.ranges)
    assert all(map(np.array_equal, given.fuzzy.partitions, fuzzy.partitions))
    assert repr(given.repairs) == repr(audit)
    assert plain(given)["effects"][-1] == {"name": "battery_sag", "shape": {"exponent": 1.5}, "coefficients": []}


def test_it_is_frozen_and_takes_its_fields_by_keyword():
    with pytest.raises(AttributeError):
        craft().mass = 3.0
    with pytest.raises(TypeError):
        Estimate(1.0, 0.0, 2.0)


def test_json_holds_what_is_brief_and_what_is_shown():
    answer = plain(craft(mass=2.5))
    assert answer["heavy"] is True
    assert answer["hover"] == {"value": None, "low": None, "high": None}
    assert answer["rotors"][0]["share"] == {"value": 0.2, "low": -0.8, "high": 1.2}
    assert answer["rotors"][0]["lag"] is None
    assert answer["rotors"][1]["peaks"][0]["kinds"] == ["motor", "propeller"]
    assert list(answer["curves"]) == ["yaw", "roll"]
    assert "gain" not in answer["curves"]["roll"]
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer


def test_fields_say_what_they_are():
    own = {each.name: each for each in described_fields(Craft)}
    assert own["battery"].optional
    assert own["battery"].kind is str
    assert own["kind"].scalar is str
    assert own["order"].scalar is int
    assert own["marked"].scalar is bool
    assert own["notes"].many
    assert (own["rotors"].table, own["rotors"].inner) == (True, Rotor)
    assert (own["curves"].named, own["curves"].inner) == (True, Curve)
    assert (own["hover"].inner, own["hover"].optional) == (Estimate, True)


def test_datasets_are_listed_by_path_and_tables_by_column():
    paths = [path for path, _ in datasets(Craft)]
    assert {"mass", "hover/low", "rotors/peaks/frequency", "curves/*/gain"} <= set(paths)
    assert len(paths) == len(set(paths))
    assert column(craft().rotors, "name") == ["M1", "M2 ±|*x*"]
    assert np.isclose(estimate(3.0, 2.0).half, 2.0)
