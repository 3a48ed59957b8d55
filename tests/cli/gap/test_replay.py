"""`cpfls replay`: what it writes and prints of any model and flight, and what it refuses."""

import json
import math

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.playback.replay import Playback
from cpfls_cli.result import plain
from tests.builders.artifacts import edited, with_fields
from tests.builders.studies import VEHICLE, put_file

NAMES = ["model", "nothing-moves", "rate-stays", "stated"]
FAST = ("--every", "7")


@pytest.fixture(scope="module")
def replayed(cpfls, gap_config, tmp_path_factory):
    """Play back, and give what is printed for machines, with the file that is written."""

    def call(model, *flights, options=FAST, config=gap_config):
        output = tmp_path_factory.mktemp("replay") / "replay.h5"
        return cpfls.summary("replay", config, model, *flights, "-o", output, *options), output

    return call


@pytest.fixture(scope="module")
def of_vehicle(replayed, with_attitude):
    return replayed("vehicle", *with_attitude)


def test_json_shows_every_prediction_by_signal_and_horizon(of_vehicle):
    answer, _ = of_vehicle
    assert answer["horizon_s"] == pytest.approx(0.01 * np.arange(1, 51))
    assert (answer["windows"], list(answer["models"])) == (2 * len(range(0, 2400 - 50, 7)), NAMES)
    for summary in answer["models"].values():
        assert set(summary) == {"body_rate", "attitude", "velocity", "position", "diverged"}
        assert summary["diverged"] == 0
        assert summary["velocity"] is summary["position"] is None
        for signal in ("body_rate", "attitude"):
            mae, rms = (np.array(summary[signal][name]) for name in ("mae", "rms"))
            by_axis = np.array(summary[signal]["rms_by_axis"])
            assert mae.shape == rms.shape == (50,)
            assert np.all(rms >= mae)
            assert rms == pytest.approx(np.sqrt((by_axis**2).sum(axis=1)))
            assert summary[signal]["sum"] == pytest.approx(mae.sum())


def test_nothing_moves_is_what_the_log_says(of_vehicle, with_attitude):
    answer, _ = of_vehicle
    errors = []
    for path in with_attitude:
        rate = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:4]
        starts = np.arange(0, len(rate) - 50, 7)
        errors.append(np.linalg.norm(rate[starts] - rate[starts + 20], axis=1))
    summary = answer["models"]["nothing-moves"]["body_rate"]["mae"]
    assert summary[19] == pytest.approx(np.concatenate(errors).mean())
    assert answer["models"]["rate-stays"]["body_rate"]["mae"] == pytest.approx(summary)


def test_the_vehicle_is_what_is_stated(of_vehicle):
    models = of_vehicle[0]["models"]
    assert models["model"] == models["stated"]


def test_the_file_keeps_to_its_format_and_says_the_same(cpfls, of_vehicle):
    answer, output = of_vehicle
    cpfls.done("check", output)
    held, _ = store.read(output, Playback)
    assert json.loads(json.dumps(plain(held))) == answer
    assert held.worst[0].measured.shape == (51, 3)


def test_an_extended_model_predicts_better_than_the_vehicle(replayed, extended, shifted):
    answer, _ = replayed(extended, shifted[0])
    models = answer["models"]
    assert models["model"]["attitude"] is None
    assert models["model"]["body_rate"]["sum"] < 0.05 * models["stated"]["body_rate"]["sum"]
    assert models["model"]["body_rate"]["sum"] < 0.2 * models["nothing-moves"]["body_rate"]["sum"]
    assert any("only rotation is played back" in warning for warning in answer["warnings"])


def test_an_identified_model_is_played_back(replayed, pipeline, study):
    answer, _ = replayed(pipeline.model, pipeline.flight, options=("--horizon", "0.5", "--every", "9"), config=study)
    model = answer["models"]["model"]
    assert len(model["attitude"]["mae"]) == 5
    assert np.isfinite(model["body_rate"]["mae"]).all()
    assert model != answer["models"]["stated"]


def test_options_change_what_they_say(replayed, with_attitude):
    options = ("--horizon", "0.2", "--every", "100", "--hold", "previous")
    answer, output = replayed("vehicle", with_attitude[0], options=options)
    assert (len(answer["horizon_s"]), answer["windows"]) == (20, len(range(0, 2380, 100)))
    assert [flight["hold"] for flight in answer["flights"]] == ["previous"]
    with h5py.File(output) as file:
        assert file["hold"][()].decode() == "previous"


def test_commands_stay_between_samples(replayed, shifted, tmp_path):
    log = put_file(tmp_path / "commanded.csv", shifted[0].read_text().replace("om", "cmd"))
    named = "import.signals.rotor_command={columns: [cmd1, cmd2, cmd3, cmd4], unit: rad/s}"
    answer, _ = replayed("vehicle", log, options=(*FAST, "--set", named))
    (flight,) = answer["flights"]
    assert (flight["driven_by"], flight["hold"]) == ("rotor commands", "previous")


def test_a_stated_torque_drives_a_flight_without_rotors(replayed, with_attitude, tmp_path):
    """The torque that the rotors give, written out: it drives the same playback."""
    table = np.loadtxt(with_attitude[0], delimiter=",", skiprows=1)
    squared = table[:, 4:8] ** 2
    arm = 0.3 * 121.5e-6
    torque = [arm * (squared[:, 3] - squared[:, 1]), arm * (squared[:, 2] - squared[:, 0])]
    torque.append(2.7e-6 * (squared @ [-1, 1, -1, 1]))
    log, header = tmp_path / "stated.csv", "t,wx,wy,wz,mx,my,mz,phi,theta,psi"
    logged = np.column_stack([table[:, :4], *torque, table[:, 8:]])
    np.savetxt(log, logged, delimiter=",", header=header, comments="", fmt="%.12g")
    named = ("--set", "import.signals.body_torque={columns: [mx, my, mz], unit: N m}")
    options = (*FAST, "--set", "import.torque_source=column", *named, "--hold", "linear")
    stated, _ = replayed("vehicle", log, options=options)
    driven, _ = replayed("vehicle", with_attitude[0])
    assert stated["flights"][0]["driven_by"] == "stated torque"
    sums = [answer["models"]["model"]["body_rate"]["sum"] for answer in (stated, driven)]
    assert sums[0] == pytest.approx(sums[1], rel=1e-3)


def test_a_simulated_flight_of_the_vehicle_itself_is_predicted(cpfls, replayed, tmp_path):
    config, path, flight = tmp_path / "study.yaml", tmp_path / "path.h5", tmp_path / "flight.h5"
    config.write_text(
        "seed: 1\ntrajectory: {legs: 1, displacement_m: 2.0, period_s: 0.4, sample_time_s: 0.01, yaw_turn_rad: 3.0}\n"
        "simulation: {closed_loop: {integration_rate_hz: 200.0}}\n" + VEHICLE
    )
    cpfls.done("trajectory", config, "-o", path)
    cpfls.done("simulate", config, path, "--mode", "closed-loop", "-o", flight)
    answer, _ = replayed("vehicle", flight, options=(*FAST, "--set", "seed=1"), config=config)
    for signal in ("body_rate", "attitude", "velocity", "position"):
        sums = {name: summary[signal]["sum"] for name, summary in answer["models"].items()}
        assert sums["model"] < 0.03 * min(sums["nothing-moves"], sums["rate-stays"]), signal


@pytest.fixture(scope="module")
def eight_seconds(cpfls, gap_config, with_attitude, tmp_path_factory):
    """The beginning of a flight: 800 samples."""
    output = tmp_path_factory.mktemp("eight") / "flight.h5"
    cpfls.done("import", gap_config, with_attitude[0], "--set", "import.crop_s=[0.0, 7.99]", "-o", output)
    return output


def test_windows_do_not_cross_a_pause(replayed, eight_seconds, tmp_path):
    held = vars(store.read(eight_seconds, Flight)[0])
    rows = {name: values for name, values in held.items() if isinstance(values, np.ndarray) and len(values) == 800}
    paused = {name: np.delete(values, slice(300, 350), axis=0) for name, values in rows.items()}
    with_fields(eight_seconds, tmp_path / "paused.h5", **paused)
    answer, output = replayed("vehicle", tmp_path / "paused.h5", options=("--every", "1"))
    assert answer["windows"] == (300 - 50) + (800 - 350 - 50)
    assert any("2 stretches without a pause" in warning for warning in answer["warnings"])
    start = store.read(output, Playback)[0].window_start
    assert not np.any((start > 2.49) & (start < 3.49))


def test_a_log_is_played_back_on_both_sides_of_its_gaps(replayed, with_attitude, tmp_path):
    lines = with_attitude[0].read_text().splitlines()
    log = tmp_path / "paused.csv"
    log.write_text("\n".join([lines[0], *lines[1:301], *lines[401:501], *lines[561:701]]) + "\n")
    answer, output = replayed("vehicle", log, options=("--every", "1"))
    assert answer["windows"] == (300 - 50) + (100 - 50) + (140 - 50)
    assert any("3 stretches without a pause, 540 of 540 samples" in warning for warning in answer["warnings"])
    start = store.read(output, Playback)[0].window_start
    assert (start[0], start[250], start[-1]) == pytest.approx((0.0, 4.0, 6.49), abs=1e-6)


def test_unknown_samples_part_a_flight_too(replayed, eight_seconds, tmp_path):
    flight = put_file(tmp_path / "flight.h5", eight_seconds.read_bytes())
    with edited(flight) as file:
        file["rotor_speed"][500:510] = math.nan
    answer, _ = replayed("vehicle", flight, options=("--every", "1"))
    assert answer["windows"] == (500 - 50) + (800 - 510 - 50)


def test_a_model_that_runs_away_is_counted_bounded_and_named(cpfls, gap_config, with_attitude, tmp_path):
    words = ("--set", "vehicle.inertia_kg_m2=[0.0006, 0.0006, 0.0012]", *FAST)
    result = cpfls("replay", gap_config, "vehicle", with_attitude[0], "-o", tmp_path / "r.h5", "--json", *words)
    model = json.loads(result.stdout)["models"]["model"]
    assert model["diverged"] > 100
    assert max(model["body_rate"]["mae"]) < 1000
    result = cpfls("replay", gap_config, "vehicle", with_attitude[0], "-o", tmp_path / "r.h5", "--force", *words)
    assert f"the vehicle of the config: runs away in {model['diverged']} of 336 windows, first in flight_4.csv" in (
        result.stderr
    )


def test_people_read_to_which_horizon_it_is_better(cpfls, gap_config, extended, shifted, tmp_path):
    result = cpfls.done("replay", gap_config, extended, shifted[0], "-o", tmp_path / "r.h5", *FAST)
    assert result.stdout.startswith(
        "REPLAY: extended.h5 predicts better than what it has to beat, summed over all horizons to 0.5 s: body rate."
    )
    assert "better than “rate fades” at" in result.stdout
    assert "Prediction" not in result.stdout
    assert "more with -v: Errors by horizon; Where it is farthest off" in result.stdout
    assert "% smaller" in result.stdout
    assert "only rotation is played back" in result.stderr


@pytest.mark.usefixtures("sketched")
def test_report_shows_it(cpfls, gap_config, of_vehicle, tmp_path):
    summary = cpfls.summary("report", gap_config, of_vehicle[1], "-o", tmp_path / "page.html")
    assert "replay" in summary["sections"]
    figures = ["replay-1-errors", "replay-1-worst", "replay-1-drawn", "replay-1-where"]
    assert [name for name in summary["figures"] if name.startswith("replay")] == figures


def test_a_report_of_it_alone_has_a_title_of_its_own(cpfls, gap_config, of_vehicle, tmp_path):
    page = cpfls.made("report", gap_config, of_vehicle[1], at=tmp_path / "page.md")
    assert page.read_text().startswith("# What a model predicts of flights\n")


@pytest.fixture
def refused(refuse, gap_config, tmp_path):
    def call(model, *flights, options=()):
        (message,) = refuse("replay", gap_config, model, *flights, "-o", tmp_path / "x.h5", *options)
        return message

    return call


def test_a_flight_without_rotors_is_refused(refused, shifted, tmp_path):
    table = np.loadtxt(shifted[0], delimiter=",", skiprows=1)[:, :4]
    log = tmp_path / "still.csv"
    np.savetxt(log, table, delimiter=",", header="t,wx,wy,wz", comments="", fmt="%.9g")
    assert refused("vehicle", log).startswith(
        "still.csv: has no rotor_speed, rotor_command or body_torque, so nothing drives a playback"
    )


def test_a_horizon_longer_than_the_flight_or_shorter_than_a_sample_is_refused(refused, shifted):
    message = refused("vehicle", shifted[0], options=("--horizon", "30"))
    assert message.startswith(
        "flight_1.csv: a horizon of 30 s is longer than its longest stretch without a pause, 23.99 s"
    )
    message = refused("vehicle", shifted[0], options=("--horizon", "0.001"))
    assert message == "--horizon 0.001 s is shorter than a sample of flight_1.csv, 0.01 s"


def test_a_model_of_another_vehicle_is_refused(refused, extended, shifted):
    assert refused(extended, shifted[0], options=("--set", "vehicle.mass_kg=5.5")).startswith(
        f"{extended}: was made with another vehicle; these differ: vehicle.mass_kg (6.0 there, 5.5"
    )


def test_an_identified_model_needs_the_attitude(refused, pipeline, shifted):
    message = refused(pipeline.model, shifted[0], options=("--set", "vehicle.rotor_speed_max_rad_s=1000.0"))
    assert message == "flight_1.csv: lacks the attitude, which the model needs: its inertia depends on it"


def test_flights_of_different_rates_are_refused(refused, shifted, tmp_path):
    table = np.loadtxt(shifted[0], delimiter=",", skiprows=1)[::2]
    log = tmp_path / "slow.csv"
    np.savetxt(log, table, delimiter=",", header="t,wx,wy,wz,om1,om2,om3,om4", comments="", fmt="%.9g")
    message = refused("vehicle", shifted[1], log)
    assert message.startswith("slow.csv: sampled at 50 Hz, flight_2.csv at 100 Hz")
    assert "--set import.rate_hz=50 for logs" in message
