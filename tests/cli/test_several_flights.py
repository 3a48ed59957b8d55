"""Several flights at once, and flights too long to hold."""

import h5py
import numpy as np
import pytest

from cpfls_cli.artifacts import job
from cpfls_cli.config.load import load_study
from cpfls_cli.errors import InputError
from cpfls_cli.files import read_content
from cpfls_cli.flights import training
from cpfls_cli.flights.recordings import imported
from tests.builders.artifacts import edited
from tests.builders.command_line import run
from tests.builders.studies import put_file
from tests.builders.thinned_logs import Flown, write_px4

SWAPPED = {"CA_ROTOR0_PX": -0.16, "CA_ROTOR0_PY": -0.16, "CA_ROTOR1_PX": 0.16, "CA_ROTOR1_PY": 0.16}


@pytest.fixture(scope="module")
def second(cpfls, study, tmp_path_factory):
    """Another flight of the tiny study, the other way round."""
    folder = tmp_path_factory.mktemp("second")
    turned = ("--set", "trajectory.yaw_turn_rad=-6.283185307179586", "--set", "trajectory.displacement_m=50.0")
    for words in (
        ("trajectory", study, *turned, "-o", folder / "trajectory.h5"),
        ("simulate", study, folder / "trajectory.h5", "-o", folder / "second.h5"),
    ):
        cpfls.done(*words)
    return folder / "second.h5"


def stored(path, *names):
    with h5py.File(path) as file:
        return [np.asarray(file[name][()]) for name in names]


def test_two_flights_train_one_model(cpfls, study, pipeline, second, tmp_path):
    model = cpfls.made("identify", study, pipeline.flight, second, "--seed", "3", at=tmp_path / "model.h5")
    lengths = [len(stored(path, "time")[0]) for path in (pipeline.flight, second)]
    (indices, samples) = stored(model, "training_indices", "judged/samples")
    np.testing.assert_array_equal(indices, np.arange(sum(lengths)))
    assert samples[0] == sum(lengths)
    with h5py.File(model) as file:
        assert {role: group.attrs["name"] for role, group in file["inputs"].items()} == {
            "flight": pipeline.flight.name,
            "flight-2": second.name,
        }


def test_a_selection_of_two_flights_counts_them_one_after_the_other(cpfls, study, pipeline, second, tmp_path):
    selection, model = tmp_path / "selection.h5", tmp_path / "model.h5"
    share = ("--set", "identification.training_share=0.6")
    cpfls.done("reduce", study, pipeline.flight, second, "-o", selection, *share)
    (indices,) = stored(selection, "indices")
    first = len(stored(pipeline.flight, "time")[0])
    assert np.any(indices < first)
    assert np.any(indices >= first)
    # Of each flight only the leading part trains.
    assert not np.any((indices >= round(0.6 * first)) & (indices < first))
    cpfls.done("identify", study, pipeline.flight, second, "--selection", selection, "-o", model, *share)
    learned, parts = stored(model, "training_indices", "judged/parts")
    np.testing.assert_array_equal(learned, np.sort(indices))
    assert parts.tolist() == [
        b"training",
        f"held-out rest of {pipeline.flight.name}".encode(),
        f"held-out rest of {second.name}".encode(),
    ]


def test_a_selection_must_be_of_the_same_flights(cpfls, refuse, study, pipeline, second, tmp_path):
    selection = cpfls.made("reduce", study, pipeline.flight, second, at=tmp_path / "selection.h5")
    output = ("-o", tmp_path / "model.h5")
    (message,) = refuse("identify", study, pipeline.flight, "--selection", selection, *output)
    assert "was made from 2 flights, and 1 is given; " in message
    (message,) = refuse("identify", study, second, pipeline.flight, "--selection", selection, *output)
    assert "was made from another flight" in message


def test_each_file_is_hashed_once(cpfls, study, pipeline, second, tmp_path, monkeypatch):
    hashed = []

    def counting(path):
        hashed.append(path)
        return read_content(path)

    for stage in (job, training):
        monkeypatch.setattr(stage, "read_content", counting)
    selection, flights = tmp_path / "selection.h5", [pipeline.flight, second]
    cpfls.done("reduce", study, *flights, "-o", selection)
    assert sorted(hashed) == sorted(flights)
    hashed.clear()
    cpfls.done("identify", study, *flights, "--selection", selection, "-o", tmp_path / "model.h5")
    assert sorted(hashed) == sorted([*flights, selection])


def test_a_flight_trains_once(refuse, study, pipeline, tmp_path):
    copy = put_file(tmp_path / "copy.h5", pipeline.flight.read_bytes())
    (message,) = refuse("identify", study, pipeline.flight, copy, "-o", tmp_path / "model.h5")
    assert "holds the same flight as" in message


def test_a_flight_read_chunk_by_chunk_gives_the_same_bytes(cpfls, study, pipeline, second, tmp_path, monkeypatch):
    words = (study, pipeline.flight, second, "--set", "identification.training_share=0.8")
    for name, limit in (("held", None), ("streamed", 100)):
        if limit:
            monkeypatch.setattr(training, "IN_MEMORY", limit)
        cpfls.done("reduce", *words, "-o", tmp_path / f"{name}-selection.h5")
        cpfls.done("identify", *words, "-o", tmp_path / f"{name}-model.h5")
    for kind in ("selection", "model"):
        assert (tmp_path / f"held-{kind}.h5").read_bytes() == (tmp_path / f"streamed-{kind}.h5").read_bytes()


@pytest.mark.parametrize(
    ("dataset", "value", "said"),
    [("torque", np.nan, "torque: 3 of 1647 values are not finite"), ("time", 0.0, "time: does not ascend at index 7")],
)
def test_a_long_flight_is_checked_too(refuse, study, pipeline, tmp_path, monkeypatch, dataset, value, said):
    monkeypatch.setattr(training, "IN_MEMORY", 100)
    broken = put_file(tmp_path / "broken.h5", pipeline.flight.read_bytes())
    with edited(broken) as file:
        file[dataset][7] = value
    (message,) = refuse("identify", study, broken, "-o", tmp_path / "model.h5")
    assert said in message


def test_a_long_flight_without_torque_is_refused_where_it_is_needed(
    cpfls, refuse, study, pipeline, tmp_path, monkeypatch
):
    monkeypatch.setattr(training, "IN_MEMORY", 100)
    lacking = put_file(tmp_path / "lacking.h5", pipeline.flight.read_bytes())
    with edited(lacking) as file:
        del file["torque"]
    cpfls.done("reduce", study, lacking, "-o", tmp_path / "selection.h5")
    (message,) = refuse("identify", study, lacking, "-o", tmp_path / "model.h5")
    assert "lacks torque" in message


@pytest.fixture(scope="module")
def flown():
    return Flown("px4", seconds=8.0)


@pytest.fixture(scope="module")
def log(flown, tmp_path_factory):
    return write_px4(tmp_path_factory.mktemp("log") / "flight.ulg", flown)


@pytest.fixture(scope="module")
def config(log):
    done = run.done("init", log, "-o", log.with_name("study.yaml"), "--mass", 1.2)
    said = "rotor commands are rebuilt from vehicle_torque_setpoint and CA_ROTOR*: 50 Hz instead of 10; they explain"
    assert said in " ".join(done.output.split())
    assert "too slow" not in done.output
    return log.with_name("study.yaml")


def commands(path, config):
    return imported(path, load_study(config))


def test_a_config_of_init_imports_rebuilt_motors(flown, log, config):
    flight = commands(log, config)
    assert flight.updated_hz["rotor_command"] == pytest.approx(50, rel=0.02)
    at = np.searchsorted(flown.time, flight.span_s[0] + flight.time + 1e-6, side="right") - 1
    truth = flown.command[at]
    differing = truth - truth.mean(axis=1, keepdims=True)
    own = flight.rotor_command - flight.rotor_command.mean(axis=1, keepdims=True)
    # What is left is held for 20 ms.
    assert ((own - differing) ** 2).sum() < 0.2 * (differing**2).sum()


def test_who_names_the_logged_columns_gets_them(log, config):
    text = config.read_text()
    own = text.replace("gap_s: 0.1", "gap_s: 0.3")
    for motor in range(4):
        own = own.replace(f'"rebuilt.rotor[{motor}]"', f'"actuator_motors.control[{motor}]"')
    assert own != text
    named = put_file(config.with_name("logged.yaml"), own)
    assert commands(log, named).updated_hz["rotor_command"] == pytest.approx(10, rel=0.02)


def test_a_log_of_which_nothing_can_be_rebuilt_is_refused(flown, config, tmp_path):
    wrong = write_px4(tmp_path / "wrong.ulg", flown, more=SWAPPED)
    with pytest.raises(InputError, match=r"cannot be rebuilt.*about.*name the logged commands"):
        commands(wrong, config)
