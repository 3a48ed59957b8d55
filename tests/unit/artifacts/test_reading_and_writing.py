"""Artifacts are written whole and read as they were."""

import contextlib
import io
import os
import stat
from dataclasses import fields, replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.artifacts.output import (
    EnduringFile,
    check_folder,
    check_output,
    filled_folder,
    locked,
    write_files,
    write_text,
)
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.config.study import Study
from cpfls_cli.dynamics import InertiaFunctions
from cpfls_cli.errors import ComputationError, InputError, OutputError
from cpfls_cli.flights.models import any_model, found_vehicle, holds_forecast, is_found, is_model, modelled, read_model
from cpfls_cli.playback.constants import ExplainedBand, UsedInstruments
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.reduction.training_set import Selection
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.result import plain
from tests.builders.results import drawn
from tests.builders.vehicle_models import HEXA, QUAD, remainder, vehicle_of, whole, wrench_somewhere, write_vehicle

ORIGIN = store.Origin(
    stage="reduce", seed=4, config="seed: 4\n", inputs={"flight": InputFile("f.h5", "ab" * 32, "cpfls/flight")}
)
ALL_ROUND = np.eye(72, dtype=bool)


def write(path, seed=1, **changes):
    given = drawn(Selection, np.random.default_rng(seed))
    for name, value in changes.items():
        object.__setattr__(given, name, value)
    store.write(path, given, ORIGIN)


def test_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "s.h5"
    write(path)
    assert (store.format_name(path), store.read_origin(path)) == ("cpfls/selection", ORIGIN)
    before = path.read_bytes()
    write(path, seed=2)
    assert before != path.read_bytes()
    path.write_bytes(path.read_bytes()[:-1])
    assert store.format_name(path) is None
    for read in (store.read_origin, lambda path: store.read(path, Selection)):
        with pytest.raises(InputError, match="does not end in the checksum"):
            read(path)


@pytest.mark.parametrize("old", [None, b"precious"])
def test_failure_in_the_middle_leaves_the_old_file_and_nothing_else(tmp_path, old):
    path = tmp_path / "s.h5"
    if old is not None:
        path.write_bytes(old)
    with pytest.raises(ComputationError, match="indices: holds"):
        write(path, indices=np.array([0.5, 1.5]))
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == ([] if old is None else [("s.h5", old)])


def test_interrupt_while_writing_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    path = tmp_path / "s.h5"
    write(path)
    before = path.read_bytes()
    monkeypatch.setattr("os.replace", interrupt)
    for act in (lambda: write(path, seed=2), lambda: write_text(path, "page")):
        with pytest.raises(KeyboardInterrupt):
            act()
        assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("s.h5", before)]


def test_files_get_the_permissions_of_any_new_file(tmp_path):
    previous = os.umask(0o027)
    try:
        write(tmp_path / "s.h5")
        write_text(tmp_path / "page.html", "page")
    finally:
        os.umask(previous)
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()} == {0o640}


def test_pipe_is_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="is a device or a pipe"):
        store.read_origin(pipe)


def test_format_name_of_what_is_no_artifact(tmp_path):
    (tmp_path / "log.csv").write_text("t\n0\n")
    assert store.format_name(tmp_path / "log.csv") is None
    assert store.format_name(tmp_path / "none") is None


def test_only_what_was_half_written_of_an_output_is_tidied(tmp_path):
    half = [tmp_path / f".{name}.ab_12xyz.part" for name in ("model.h5", "model.h5.checkpoint", "model.h5.partial")]
    kept = [tmp_path / name for name in (".model.h5.old.ab_12xyz.part", ".other.h5.ab_12xyz.part", "model.h5")]
    for path in (*half, *kept):
        path.write_text("")
    with locked(tmp_path / "model.h5", "identify"):
        assert sorted(tmp_path.iterdir()) == sorted([*kept, tmp_path / ".model.h5.lock"])
    assert sorted(tmp_path.iterdir()) == sorted(kept)


def test_of_several_texts_all_are_written_or_none(tmp_path, monkeypatch):
    sync = iter([None, OSError(28, "No space left on device")])

    def fail_at_the_second(_):
        if error := next(sync):
            raise error

    monkeypatch.setattr("os.fsync", fail_at_the_second)
    with pytest.raises(OutputError, match=r"model\.c: cannot be written: No space left on device"):
        write_files({tmp_path / "model.h": "header", tmp_path / "model.c": "source"})
    assert list(tmp_path.iterdir()) == []


def fill(folder, error=None):
    with filled_folder(folder, ["a.txt", "b.txt"]) as temporary:
        (temporary / "a.txt").write_text("new")
        if error is not None:
            raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError()])
def test_an_interrupt_leaves_everything_in_a_folder_as_it_was(tmp_path, error):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "a.txt").write_text("old")
    (folder / "b.txt").write_text("old")
    with pytest.raises(type(error)):
        fill(folder, error)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "old", "b.txt": "old"}
    assert list(tmp_path.iterdir()) == [folder]


def test_what_appears_while_a_command_is_at_work_is_kept(tmp_path):
    output, second = tmp_path / "a.txt", tmp_path / "b.txt"
    for path in (output, second):
        check_output(path, force=False)
    second.write_text("mine")
    with pytest.raises(OutputError, match=r"b\.txt: appeared while the command was running"):
        write_files({output: "new", second: "new"})
    assert [path.name for path in tmp_path.iterdir()] == ["b.txt"]
    assert second.read_text() == "mine"
    check_output(second, force=True)
    write_files({output: "new", second: "new"})
    # A command may write its own output again.
    write_files({output: "newer"})
    assert (output.read_text(), second.read_text()) == ("newer", "new")


def test_what_appears_in_a_folder_is_kept(tmp_path):
    folder = tmp_path / "out"
    check_folder(folder, False, ["a.txt", "b.txt"])
    folder.mkdir()
    (folder / "b.txt").write_text("mine")
    fill(folder)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "new", "b.txt": "mine"}
    (folder / "a.txt").unlink()
    (folder / "b.txt").unlink()
    check_folder(folder, False, ["a.txt", "b.txt"])
    (folder / "a.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"a\.txt: appeared while the command was running"):
        fill(folder)
    assert (folder / "a.txt").read_text() == "mine"


@pytest.mark.parametrize("room", range(0, 66_000, 2_797))
def test_hdf5_meets_a_full_disk(tmp_path, room):
    """Whatever HDF5 writes last, and however it closes the file, the failure is kept and nothing crashes."""

    class Disk(io.FileIO):
        def write(self, content):
            if self.tell() + len(content) > room:
                raise OSError(28, "No space left on device")
            return super().write(content)

    with Disk(tmp_path / "full.h5", "w+") as raw:
        file = EnduringFile(raw)
        with contextlib.suppress(OSError, RuntimeError), h5py.File(file, "w") as written:
            for name in "abc":
                written.create_dataset(name, (1000, 3), float, chunks=(100, 3), compression="gzip")
                written[name][...] = np.random.default_rng(1).random((1000, 3))
        with pytest.raises(OSError, match="No space left"):
            file.require_written()


def made(**values):
    return IdentifiedModel(**{**dict.fromkeys(own.name for own in fields(IdentifiedModel)), **values})


def functions(count, visited):
    structure = model_structure(StructureSettings(membership_functions=count))
    return InertiaFunctions(structure, (), (), np.zeros(0), np.zeros(6), visited)


@pytest.mark.parametrize(
    ("reason", "stopped"),
    [("generations", ""), ("converged", ""), ("time-limit", "time-limit"), ("interrupted", "interrupted")],
)
def test_a_search_is_complete_where_it_came_to_its_end(reason, stopped):
    own = made(stop_reason=reason)
    assert (own.complete, own.stopped) == (not stopped, stopped)


@pytest.mark.parametrize(
    ("count", "visited", "rank", "condition", "same", "known"),
    [
        (1, ALL_ROUND, 5, 3.0, True, True),
        (1, ALL_ROUND, 5, 100.0, True, True),
        (1, ALL_ROUND, 5, 100.1, True, False),
        (1, ALL_ROUND, 4, 3.0, True, False),
        (3, ALL_ROUND, 5, 3.0, False, False),
        (1, ALL_ROUND[:, :71], 5, 3.0, False, False),
    ],
)
def test_one_rule_holds_everywhere_where_training_went_all_round_and_determined_it(
    count, visited, rank, condition, same, known
):
    model = SimpleNamespace(fuzzy=functions(count, visited))
    own = made(model=model, rank=rank, parameters=5, condition_number=condition)
    assert (own.functions.same_everywhere, own.known_everywhere) == (same, known)


def test_what_a_search_left_is_known_from_its_model():
    off = made(ridge_weight=np.inf, weights=np.zeros(0, dtype=int))
    on = made(ridge_weight=0.1, weights=np.ones(4, dtype=int))
    assert (off.fuzzy_part_off, off.searched) == (True, False)
    assert (on.fuzzy_part_off, on.searched) == (False, True)
    assert (made().trust, made().validated) == ("not-judged", False)


MODELS = {
    "quad": whole(),
    "hexa, seesaw": whole(HEXA, order=0),
    "one rule": whole(remainder=remainder(1, breakpoints=(0.0,))),
    "plain": VehicleModel(vehicle=QUAD),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
def test_the_round_trip_is_exact(model, tmp_path):
    path = write_vehicle(tmp_path / "vehicle.h5", vehicle_of(model))
    assert store.examine(path, Vehicle)[2] == []
    assert is_model(path)
    assert is_found(path)
    again = any_model(path).model
    assert again.vehicle == model.vehicle
    assert again.response == model.response
    assert [(one.name, one.shape) for one in again.effects] == [(one.name, one.shape) for one in model.effects]
    assert np.array_equal(wrench_somewhere(again), wrench_somewhere(model))


def test_instruments_have_bands_of_their_own(tmp_path):
    vehicle, path = vehicle_of(MODELS["plain"]), tmp_path / "vehicle.h5"
    loop = vehicle.loop._replace(band_hz=np.ones((4, 2)), by_band=np.ones((4, 3)), missed=np.full(3, 0.1))
    three = np.full(3, 0.9)
    bands = (ExplainedBand(1.0, 2.0, np.ones(3), True),) * 5
    used = UsedInstruments(kind="past", bands=bands, explained=three, explained_error=three)
    write_vehicle(path, replace(vehicle, loop=loop, instruments=used))
    again = found_vehicle(path)
    assert (len(again.loop.by_band), len(again.instruments.bands), again.loop.misses) == (4, 5, True)


def test_an_effect_that_nobody_knows_is_refused(tmp_path):
    unknown = replace(MODELS["plain"], effects=(ModelEffect("rotor_dragg", {}, np.ones(1)),))
    with pytest.raises(InputError, match=r"rotor_dragg: no such effect \(did you mean rotor_drag"):
        modelled(tmp_path / "v.h5", vehicle_of(unknown))


@pytest.mark.parametrize("kind", [IdentifiedModel, Vehicle])
def test_every_model_answers_the_same_questions(kind):
    assert issubclass(kind, AnyModel)


def test_machines_read_what_the_model_has():
    answer = plain(vehicle_of(MODELS["quad"]))["model"]
    assert (answer["vehicle"]["mass_kg"], answer["vehicle"]["inertia_kg_m2"][4]) == (0.9, -2e-4)
    assert answer["response"]["lag_s"] == 0.035
    assert [each["name"] for each in answer["effects"]] == [one.name for one in MODELS["quad"].effects]
    assert answer["remainder"]["rows"] == [0, 2, 5]


def test_a_forecast_has_parts_of_its_own(tmp_path):
    """Its axes are as long as they like, and replays take it where others take the vehicle."""
    path, study = tmp_path / "vehicle.h5", Study()
    write_vehicle(path, vehicle_of(MODELS["plain"], forecast=MODELS["quad"]))
    again = found_vehicle(path)
    assert holds_forecast(path)
    assert not read_model(path, study).effects
    assert read_model(path, study, forecast=True).effects
    assert not again.model.effects
    assert [one.name for one in again.forecast.effects] == [one.name for one in MODELS["quad"].effects]
    assert again.forecast.remainder.rows.tolist() == MODELS["quad"].remainder.rows.tolist()
