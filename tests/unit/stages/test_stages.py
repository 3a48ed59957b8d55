"""What single stages add to numerics: extensions, figures of look, reductions, and what goes on from a vehicle."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.artifacts.job import Job
from cpfls_cli.artifacts.model import LearnedFlight
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.naming.results import GapVerdict
from cpfls_cli.logs.formats import DATAFLASH_MAGIC
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.report.canvas import picture_of
from cpfls_cli.report.content import command_line
from cpfls_cli.result import Estimate
from cpfls_cli.stages._numbers import to_fly
from cpfls_cli.stages.diagnose import learned_from, next_command
from cpfls_cli.stages.extend import named_effects
from cpfls_cli.stages.init import init
from cpfls_cli.stages.look import FIGURES
from cpfls_cli.stages.reduce import _naming
from cpfls_cli.stages.vehicle import held_s, next_commands
from cpfls_cli.validation.trust import Trust
from tests.builders import gap_artifacts as made
from tests.builders.vehicle_search import CONFIG


def test_a_command_is_held_for_as_long_as_its_log_says_nothing_new():
    """Not where speeds are measured, nor where lines join commands that are logged rarely."""

    def flight(commanded, hold, hz):
        return LoggedFlight((SimpleNamespace(commanded=commanded),), hold, "", (), updated_hz=hz)

    assert held_s([flight(True, "previous", 50.0), flight(True, "previous", 100.0)]) == pytest.approx(0.015)
    assert held_s([flight(True, "linear", 20.0), flight(False, "previous", 100.0)]) == 0.0
    assert held_s([flight(True, "previous", 50.0), flight(False, "linear", 100.0)]) == pytest.approx(0.02)
    assert held_s([flight(False, "linear", 100.0)]) == 0.0


@pytest.mark.parametrize("verdict", [GapVerdict.UNEXPLAINED, GapVerdict.NO_GAP, GapVerdict.NOT_EXCITED])
def test_only_names_are_added(verdict):
    found = made.diagnosis()
    with pytest.raises(ComputationError, match=f"the diagnosis is {verdict} and names no effect"):
        named_effects(replace(found, verdict=verdict))
    with pytest.raises(ComputationError, match="names no effect"):
        named_effects(replace(found, effects=(), closest=found.effects))
    for good in (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS):
        assert named_effects(replace(found, verdict=good)) == found.effects


def test_axes_that_get_worse_are_warned_of():
    before, gap = np.array([2.0, 1.4, 10.0, 3.0, np.nan, 1.0]), made.extended().gap
    for factor, axes in ((1.3, [0, 2]), (1.1, [])):
        grown = replace(made.extended(), gap=replace(gap, before_floors=before, after_floors=factor * before))
        assert (grown.gap.worse_axes, len(grown.warnings)) == (axes, len(axes))


def test_numbers_that_overflow_are_an_error_that_names_the_flight():
    said = r"own/flight\.h5: the regressor has numbers too far apart"
    with pytest.raises(ComputationError, match=said), _naming([Path("own/flight.h5")]):
        np.linalg.eigvalsh(np.full((3, 3), np.nan))


HZ = np.array([1.0, 2.0, 5.0, 10.0])
ROTORS = tuple(
    SimpleNamespace(rotor=at, share=Estimate.around(1.0 + 0.1 * at, 0.05), expected=1.0 + 0.02 * at) for at in (1, 2)
)
PLANT = SimpleNamespace(
    axis="pitch",
    identified=True,
    frequency=HZ,
    gain=np.array([80.0, 70.0, 60.0, 900.0]),
    gain_error=np.array([0.1, 0.1, 0.1, 3.0]),
    model_gain=np.array([80.0, 75.0, 50.0, 30.0]),
    direct_gain=np.array([10.0, 20.0, 30.0, 40.0]),
    input_coherence=np.ones(4),
    output_coherence=np.array([1.0, 0.01, 1.0, 1.0]),
)
LOOP = SimpleNamespace(
    axis="roll",
    measured=True,
    time=np.linspace(0.0, 1.0, 6),
    **{name: np.linspace(0.0, end, 6) for name, end in (("step", 1.0), ("step_low", 0.9), ("step_high", 1.1))},
    by_step=SimpleNamespace(half_s=Estimate.around(0.04, 0.01)),
    law_explains=False,
    frequency=HZ,
    gain=np.array([1.0, 1.1, 0.8, 0.4]),
    gain_error=np.full(4, 0.05),
    clear_hz=6.0,
)
SPECTRUM = SimpleNamespace(signal="gyroscope", frequency=10 * HZ, density=np.full((4, 3), np.radians(0.5) ** 2))
VIBRATION = SimpleNamespace(
    map_db=np.arange(8.0).reshape(2, 4),
    map_hz=10 * HZ,
    map_collective=np.array([0.3, 0.5]),
    spectra={"gyroscope": SPECTRUM},
    lines=(SimpleNamespace(hz=42.0),),
)
SHAPE = SimpleNamespace(
    collective=np.array([0.3, 0.4, 0.5]), specific_force=np.array([5.0, 8.0, 13.0]), exponent=Estimate.around(2.0, 0.1)
)
FOUND = SimpleNamespace(
    balance=SimpleNamespace(rotors=ROTORS),
    plants={"pitch": PLANT},
    loops={"roll": LOOP},
    vibration=VIBRATION,
    hover=SimpleNamespace(shape=SHAPE),
)
NOTHING = SimpleNamespace(balance=None, plants={}, loops=None, vibration=None, hover=None, tracks={}, events=())


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("balance", {("share", "M1", "10.00"), ("95 %", "M2", "25.00"), ("equal rotors", "M2", "4.000")}),
        # Points that no coherence or interval supports are left out.
        ("effectiveness", {("pitch", "10", "30.00"), ("", "5", "60.00"), ("least squares", "10", "40.00")}),
        # Ten times as long as half of it takes.
        ("step", {("roll", "0.4000", "0.4000"), ("", "0.4000", "0.3600")}),
        ("response", {("roll", "5", "0.8000")}),
        ("spectra", {("as logged", "100", "0.5000")}),
        ("thrust", {("", "0.5000", "13.00"), ("exponent 2.00", "0.5000", "13.00")}),
    ],
)
def test_it_draws_what_was_found(name, rows):
    shown = {row[1:] for row in picture_of(FIGURES[name], name, FOUND).rows}
    assert rows <= shown
    assert not {row for row in shown if row[2] == "900.0" or (name == "effectiveness" and row[2] == "70.00")}
    assert not {row for row in shown if name in ("step", "response") and float(row[1]) > 6.0}


@pytest.mark.usefixtures("drawn")
def test_the_map_is_a_picture():
    assert 'href="data:image/png' in picture_of(FIGURES["vibration-map"], "vibration-map", FOUND).svg


def test_where_nothing_was_found_nothing_is_drawn():
    assert {name: picture_of(draw, name, NOTHING) for name, draw in FIGURES.items()} == dict.fromkeys(FIGURES)


@pytest.mark.parametrize("trust", Trust)
def test_a_vehicle_that_nobody_should_use_is_flown_for_and_not_handed_over(trust):
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, Path("own/found.h5"), False, False, lambda *_: None, lambda _: None, config=Path("c.yaml"))
    record = SimpleNamespace(complete=True, trust=trust, logged_slowly=False, logged_by=())
    page, (_, command, *words) = next_commands(job, record, [Path("f.h5")], ())
    assert page[:2] == ("cpfls", "report")
    poor = trust in (Trust.LACKING, Trust.NOT_DETERMINED, Trust.LOOP, Trust.DO_NOT_USE)
    assert command == ("trajectory" if poor else "export")
    assert words[-1] == (Path("own/found-mission.h5") if poor else Path("own/found.c"))
    coarse = replace(job, study=study.model_copy(update={"trajectory": replace(study.trajectory, sample_time_s=0.1)}))
    record.trust = Trust.LOOP
    _, (*mission, _) = next_commands(coarse, record, [Path("f.h5")], ())
    assert "trajectory.sample_time_s=0.02" in mission
    # No flight shows more before its log is faster.
    slow = SimpleNamespace(complete=True, trust=trust, logged_slowly=True)
    assert next_commands(job, slow, [Path("f.h5")], ()) == (page,)


def test_logs_of_ardupilot_are_followed_by_sweeps_of_its_own(tmp_path):
    (log := tmp_path / "one.BIN").write_bytes(DATAFLASH_MAGIC)
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, tmp_path / "found.h5", False, False, lambda *_: None, lambda _: None, inputs=[tmp_path / "c.yaml"])
    assert "ardupilot" not in to_fly(job)
    assert to_fly(replace(job, inputs=[*job.inputs, log]))[-4:-1] == ("--format", "ardupilot", "-o")


def test_logs_whose_autopilot_flies_no_mission_are_followed_by_sticks(tmp_path):
    (log := tmp_path / "fpv.bbl").write_bytes(b"H Product:Blackbox")
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, tmp_path / "found.h5", False, False, lambda *_: None, lambda _: None, inputs=[log])
    assert command_line(to_fly(job)).startswith("fly by hand, stick left and right")
    assert command_line(to_fly(replace(job, inputs=[]))).startswith("cpfls trajectory ")
    # Of flights that were imported, and of a vehicle that was found, the file says what wrote the log.
    for systems, by_hand in ((("Betaflight 4.3.0",), True), (("Betaflight 4.3.0", "PX4 1.13.3"), False), ((), False)):
        assert command_line(to_fly(replace(job, inputs=[]), systems=systems)).startswith("fly by hand") is by_hand


@pytest.mark.parametrize(
    ("rates", "goes_on"),
    # With the effects, of two that know no model, and as given: farther off; better; better, and worse than no model.
    [((0.5, 0.3, 0.3, 0.4), "response"), ((0.2, 0.3, 0.3, 0.4), "replay"), ((0.4, 0.3, 0.3, 0.6), "response")],
)
def test_a_model_that_is_not_to_be_taken_is_not_gone_on_with(rates, goes_on):
    """Leave the model as it is, was said above a command that plays the other one back."""
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, Path("own/gap"), False, False, lambda *_: None, lambda _: None, config=Path("c.yaml"))
    found = made.diagnosis("PARTIAL", playback=made.played_pair(body_rate=rates, attitude=rates))
    assert next_command(job, found, ("cpfls", "replay"), ("cpfls", "response"), Path("d.h5"))[1] == goes_on


def test_a_flight_held_out_that_was_imported_from_a_log_learned_from_is_said_to_be():
    run = SimpleNamespace(take_also=lambda *_: None)
    learned = (LearnedFlight("one.ulg", "9" * 64, "ulg"),)
    held = [LearnedFlight("two.h5", "6" * 64, "cpfls/flight", log="9" * 64)]
    (said,) = learned_from(run, made.diagnosis(), {}, learned, held, model="disagreement.h5").seen
    assert said.startswith("two.h5: the model of disagreement.h5 has learned from it")


def test_a_topic_is_unused_where_no_instance_of_it_is_used():
    guess = SimpleNamespace(columns=SimpleNamespace(columns=("imu[1].x",)))
    names = ("imu.x", "imu.y", "imu[1].y", "mag.x", "mag[1].x")
    unused = init.words["unused"](SimpleNamespace(signals=(guess,), unused=names))
    assert [*unused] == ["imu.x, imu.y", "imu[1].y", "anything of mag"]
