"""The shipped study of a real flight, through the commands: what is learned from one log holds on its rest."""

import json
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest

from tests.builders.command_line import run
from tests.builders.recorded_flights import path_of_log

CONFIG = Path(__file__).parents[2] / "configs" / "crazyflie.yaml"


def summary_of(*words):
    return json.loads(run.done(*words).stdout)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Every file of the study, and what the commands printed; the search is small, the rest as shipped."""
    logs = {name: path_of_log("real/crazyswarm2_lee", name) for name in ("log119", "log149")}
    folder = tmp_path_factory.mktemp("crazyflie")
    f119, f149, selection, model = (folder / name for name in ("f119.h5", "f149.h5", "selection.h5", "model.h5"))
    imported = {
        "log119": summary_of("import", CONFIG, logs["log119"], "-o", f119, "--json"),
        "log149": summary_of("import", CONFIG, logs["log149"], "-o", f149, "--json"),
    }
    summary_of("reduce", CONFIG, f119, "-o", selection, "--json")
    words = ("identify", CONFIG, f119, "--selection", selection, "--validate", f149, "-o", model, "--json")
    small = ("--set", "identification.population=10", "--set", "identification.generations=1")
    return SimpleNamespace(imported=imported, identified=summary_of(*words, *small), flight=f119)


def test_the_delay_is_the_one_that_was_found_by_hand(study):
    """The origin of the data states 60 to 80 ms."""
    assert 0.06 < study.imported["log119"]["delay_s"] < 0.08


@pytest.mark.parametrize("name", ["log119", "log149"])
def test_the_pause_of_the_logger_is_said_and_no_spike_is_invented(study, name):
    imported = study.imported[name]
    assert (imported["gaps"], imported["spikes"], imported["suspected_spikes"]) == (1, {}, {})
    assert 0.05 < imported["longest_gap_s"] < 0.07


def test_the_file_shows_what_was_done_about_the_gap(study):
    with h5py.File(study.flight) as file:
        assert float(file["longest_gap_s"][()]) == pytest.approx(0.0595, abs=5e-5)
        assert int(file["gaps"][()]) == 1
        assert len(file["warnings"]) == 0


@pytest.mark.usefixtures("drawn")
def test_the_page_shows_it_too(study):
    page = study.flight.with_name("page.html")
    run.done("report", CONFIG, study.flight, "-o", page)
    assert "gaps in the time stamps, up to 0.0595 s: interpolated" in page.read_text()


def test_roll_and_pitch_of_the_held_out_rest_are_explained(study):
    roll, pitch, _ = study.identified["held_out"]["held-out rest"]["r2_body"]
    assert roll > 0.9
    assert pitch > 0.9


def test_the_model_is_not_worse_than_a_rigid_body_on_the_held_out_rest(study):
    assert study.identified["fuzzy_part"] == "off"
    rest = study.identified["held_out"]["held-out rest"]
    assert rest["mse"] <= rest["baselines"]["rigid-body"]["mse"] * (1 + 1e-6)
    assert rest["mse"] < 0.1 * rest["baselines"]["torque-zero"]["mse"]


def test_the_other_flight_is_judged_and_its_roll_and_pitch_are_explained(study):
    roll, pitch, _ = study.identified["held_out"]["f149.h5"]["r2_body"]
    assert min(roll, pitch) > 0.8


def test_yaw_is_called_hardly_excited(study):
    assert any("yaw is hardly excited" in finding for finding in study.identified["findings"])
