"""Command `tune`."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from cpfls_cli import page, store
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.vibration import Change
from cpfls_cli.playback.model import ModelEffect
from cpfls_cli.playback.vehicle import Trade
from cpfls_cli.stage import loaded
from cpfls_cli.stages.tune import _spreads
from cpfls_cli.tuning.gains import Gains
from cpfls_cli.tuning.margins import evaluate
from cpfls_cli.tuning.plant import hover_plant
from tests.builders.autopilots import CROSS, STUDY, found_vehicle
from tests.builders.changed_flights import save
from tests.builders.dataflash_logs import dataflash
from tests.builders.looked import PLANTS, looked_flight, looked_plant
from tests.builders.vehicle_models import held_out, number_of, write_vehicle

ENDINGS = {"px4": ".params", "ardupilot": ".param", "betaflight": ".txt", "crazyflie": ".yaml"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tune")
    (folder / "study.yaml").write_text(STUDY)
    write_vehicle(folder / "vehicle.h5", found_vehicle(), STUDY)
    return folder


@pytest.fixture(scope="module")
def gains(cpfls, folder):
    """What the command says and writes for each autopilot."""
    answer = {}
    for name in AUTOPILOTS:
        answer[name] = cpfls.done(
            "tune", folder / "study.yaml", folder / "vehicle.h5", "--autopilot", name, "-o", folder / f"{name}.h5"
        )
    return answer


def read(path):
    gains, _ = store.read(path, Gains)
    return gains


def written(folder, name, stem=""):
    """Read the parameters of a ground station's file."""
    text = (folder / f"{stem or name}{ENDINGS[name]}").read_text()
    if name == "crazyflie":
        held = yaml.safe_load(text)
        assert (held["type"], held["version"]) == ("persistent_param_state", "1")
        return {key: row["stored_value"] for key, row in held["params"].items()}
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    if name == "px4":
        rows = [line.split("\t") for line in lines]
        assert all(row[:2] == ["1", "1"] and row[4] == "9" for row in rows)
        return {row[2]: float(row[3]) for row in rows}
    if name == "ardupilot":
        return {key: float(value) for key, value in (line.split(",") for line in lines)}
    assert lines[-1] == "save"
    return {line.split()[1]: float(line.split()[3]) for line in lines[1:-1]}


@pytest.mark.parametrize("name", ENDINGS)
def test_the_file_of_a_ground_station_holds_what_the_artifact_proposes(name, gains, folder):
    assert gains[name].exit_code == 0
    rows = read(folder / f"{name}.h5").parameters
    assert written(folder, name) == pytest.approx({each: row.proposed for each, row in rows.items()})
    ranges = {each.name: each for each in AUTOPILOTS[name].parameters}
    assert all(ranges[each].low <= row.proposed <= ranges[each].high for each, row in rows.items())
    # A comment says of each what it is, and what the documentation allows.
    assert (folder / f"{name}{ENDINGS[name]}").read_text().count("documented range") == len(rows)


def test_gains_are_those_of_the_least_favourable_vehicle(gains, folder):
    found = read(folder / "px4.h5")
    assert gains["px4"].exit_code == 0
    # Inertia and lag are identified, the thrust factor is as the config has it; some of the lag may be a delay.
    assert found.sets["proposed"].roll.plants == 9
    assert "up to 10 % of it, by its interval, may be a delay" in gains["px4"].stderr
    assert found.falls_short["proposed"] == ()
    assert all(axis.command_worst.disk_deg <= axis.command.disk_deg for axis in found.sets["proposed"].axes)
    assert found.hover_thrust == pytest.approx(0.363, abs=0.01)
    assert "THR_MDL_FAC" in found.parameters


@pytest.mark.usefixtures("gains")
def test_gains_of_a_body_by_bounds_keep_their_margins_between_them(cpfls, refuse, folder, tmp_path):
    """About yaw between the bounds of the ratio to the drag factor; of a lag that is open, over what it can be."""
    plain = found_vehicle(instrumented=False)
    known = {each.name: each for each in plain.numbers}
    held = ("inertia.Ixx", "inertia.Iyy", "inertia.Izz")
    loop = plain.loop._replace(low=np.full(3, 0.75), high=np.full(3, 1.3), missed=np.full(3, 0.02))

    def gains_of(wider):
        ends = [(known[name].value * 0.75 / wider, known[name].value * 1.3 * wider) for name in held]
        numbers = [known[name]._replace(low=low, high=high) for name, (low, high) in zip(held, ends, strict=True)]
        numbers[2] = numbers[2]._replace(
            low=known[held[2]].value / 10, high=known[held[2]].value * 10, determined=False
        )
        numbers = [each._replace(determined=each.determined and each.high < 2 * each.low) for each in numbers]
        lag = known["lag.time_constant_s"]._replace(low=0.02, high=0.04, determined=False)
        own = replace(
            plain,
            numbers=(*numbers, lag, number_of("drag_factor", determined=False)),
            correlation=np.eye(5),
            trades=(Trade("drag_factor", held[2], 1.0),),
            loop=loop,
            held_out=held_out(1.0),
        )
        return folder / "study.yaml", write_vehicle(tmp_path / f"{wider}.h5", own, STUDY), "--autopilot", "px4"

    cpfls.done("tune", *gains_of(1.0), "-o", tmp_path / "gains.h5")
    found, narrow = read(tmp_path / "gains.h5"), read(folder / "px4.h5")
    assert [axis.plants for axis in found.sets["proposed"].axes] == [9, 9, 9]
    assert found.falls_short["proposed"] == ()
    for axis, other in zip(found.sets["proposed"].axes, narrow.sets["proposed"].axes, strict=True):
        assert axis.command_worst.disk_deg < axis.command.disk_deg
        assert axis.bandwidth_hz < other.bandwidth_hz
    message = refuse("tune", *gains_of(1.1), "-o", tmp_path / "gains.h5", "--force")
    assert "constants not determined; not identified: Ixx, Iyy" in " ".join(message)


@pytest.mark.parametrize("determined", [True, False])
def test_bounds_about_yaw_count_once_for_a_drag_factor_that_has_them(determined):
    plain = found_vehicle(instrumented=False)
    loop = plain.loop._replace(low=np.full(3, 0.8), high=np.full(3, 1.25), missed=np.full(3, 0.02))
    drag = number_of("drag_factor", 1.0, 0.8, 1.25, determined=determined)
    own = replace(plain, numbers=(drag,), correlation=np.eye(1), loop=loop)
    roll, _, yaw = _spreads(own, own.model, 0.03)[0]
    assert roll.gain == (1.0, 1.0)
    assert yaw.gain == pytest.approx((0.8, 1.25))


def test_a_drag_factor_that_flights_leave_open_is_open_about_yaw():
    """With a moment that is open too it is not: then their ratio is known, and the moment bears what is assumed."""
    plain = found_vehicle(instrumented=False)
    drag, moment = number_of("drag_factor", 1.0, 0.5, 1.5, determined=False), plain.numbers[2]
    for determined, gain in ((True, (0.5, 1.5)), (False, (0.8, 1.25))):
        known = moment._replace(low=moment.value, high=moment.value, determined=determined)
        own = replace(plain, numbers=(drag, known), correlation=np.eye(2))
        roll, _, yaw = _spreads(own, own.model, 0.03)[0]
        assert (roll.gain, yaw.gain) == ((1.0, 1.0), pytest.approx(gain))


def test_of_a_lag_alone_as_much_may_be_a_delay_as_it_is_open():
    plain = found_vehicle()
    plain = replace(plain, model=replace(plain.model, response=replace(plain.model.response, delay_s=0.012)))
    delay = number_of("delay.delay_s", 0.012, 0.008, 0.016)
    for numbers, delayed in (
        (plain.numbers, 0.1),
        ((plain.numbers[3]._replace(high=0.09),), 0.5),
        ((*plain.numbers, delay), 0.0),
        ((delay,), 0.0),
    ):
        own = replace(plain, numbers=numbers, correlation=np.eye(len(numbers)))
        assert [each.delayed for each in _spreads(own, own.model, 0.03)[0]] == pytest.approx([delayed] * 3)


def test_the_delay_of_new_commands_is_open_by_as_much_as_the_number_and_not_by_its_share():
    """From 8 to 16 ms of 12 it is from 18 to 26 of 22, where a log holds a command for 20 ms."""
    plain = found_vehicle(instrumented=False)
    model = replace(plain.model, commanded=True, response=replace(plain.model.response, delay_s=0.022))
    own = replace(plain, model=model, numbers=(number_of("delay.delay_s", 0.012, 0.008, 0.016),), correlation=np.eye(1))
    assert _spreads(own, model, 0.03)[0][0].delay == pytest.approx((18 / 22, 26 / 22))


@pytest.mark.usefixtures("sketched")
def test_the_page_draws_bode_nichols_and_steps(gains, cpfls, folder):
    assert gains["px4"].exit_code == 0
    cpfls.done("report", folder / "study.yaml", folder / "px4.h5", "-o", folder / "px4.html")
    page = (folder / "px4.html").read_text()
    for figure in ("tune-1-bode-roll", "tune-1-nichols-yaw", "tune-1-step"):
        assert figure in page
    # The vehicle of the gains is the one that was found.
    assert "The vehicle of the study config" not in page
    assert "study.yaml vehicle.h5 px4.h5 -o" in " ".join(gains["px4"].stdout.replace(f"{folder}/", "").split())
    cpfls.done("report", folder / "study.yaml", folder / "vehicle.h5", folder / "px4.h5", "-o", folder / "both.html")
    assert "The vehicle of the study config" in (folder / "both.html").read_text()


def test_info_shows_the_answer_again(gains, cpfls, folder):
    said = cpfls("info", folder / "px4.h5").stdout
    assert gains["px4"].stdout.splitlines()[0] in said
    assert cpfls("info", folder / "px4.h5", "-v").stdout.count("MC_ROLLRATE_P") == 1


def test_rotors_in_another_order_are_said(gains):
    assert "mixer: rotors" not in gains["px4"].output
    assert (
        "mixer: rotors 1, 2, 3 and 4 of the config are not where those of Betaflight are" in gains["betaflight"].output
    )


def test_a_vehicle_that_flights_do_not_tell_is_refused_with_the_flight_that_is_missing(refuse, folder, tmp_path):
    vehicle = found_vehicle(instrumented=False)
    loop = vehicle.loop._replace(explained=np.full(3, 0.5))
    wide = tuple(each._replace(determined=False) for each in vehicle.numbers)
    for name, own, words, missing in (
        ("loop", replace(vehicle, loop=loop), "the flights show the loop", "cpfls trajectory"),
        ("playback", vehicle, "not judged", "one that is kept aside"),
        ("wide", replace(found_vehicle(), numbers=wide), "not identified: Ixx, Iyy, ", "cpfls trajectory"),
        ("sticks", replace(vehicle, loop=loop, logged_by=("Betaflight 4.5",)), "loop", "by hand, stick left and right"),
    ):
        path = write_vehicle(tmp_path / f"{name}.h5", own, STUDY)
        message = refuse("tune", folder / "study.yaml", path, "--autopilot", "px4", "-o", tmp_path / "g.h5")
        assert words in " ".join(message)
        assert f"The flight that is missing: {missing}" in " ".join(message)


def test_what_is_good_for_control_is_good_enough_for_gains(cpfls, gains, folder, tmp_path):
    """A log without velocity judges no simulation; gains follow from rotation."""
    own = replace(found_vehicle(instrumented=False), held_out=held_out(None))
    assert (own.verdict, gains["crazyflie"].exit_code) == ("good-for-control", 0)
    path = write_vehicle(tmp_path / "turns.h5", own, STUDY)
    cpfls.done("tune", folder / "study.yaml", path, "--autopilot", "crazyflie", "-o", tmp_path / "g.h5")
    found, before = (read(each).sets["proposed"].roll.command for each in (tmp_path / "g.h5", folder / "crazyflie.h5"))
    assert found.disk_deg == before.disk_deg


def test_gains_hold_on_an_emptier_battery_where_it_sags(cpfls, gains, folder, tmp_path):
    assert gains["px4"].exit_code == 0
    plain = found_vehicle()
    sag = ModelEffect("battery_sag", {"exponent": 2.0}, np.zeros(0))
    path = write_vehicle(tmp_path / "sag.h5", replace(plain, model=replace(plain.model, effects=(sag,))), STUDY)
    words = ("tune", folder / "study.yaml", path, "--autopilot", "px4", "-o", tmp_path / "g.h5")
    assert "margins hold from the fullest one of the flights to one at 80 % of its voltage" in cpfls.done(*words).stderr
    found, before = read(tmp_path / "g.h5"), read(folder / "px4.h5")
    assert found.hover_thrust == before.hover_thrust
    # Nothing in PX4's ranges holds yaw on both; roll and pitch are slower for it.
    assert {*found.falls_short["proposed"]} <= {"yaw"}
    assert found.sets["proposed"].roll.bandwidth_hz < before.sets["proposed"].roll.bandwidth_hz
    law = AUTOPILOTS["px4"].law(AUTOPILOTS["px4"].defaults() | {n: row.proposed for n, row in found.parameters.items()})
    hover = hover_plant(law, CROSS, plain.model, 0.03)
    for gain in (1.0, 0.8):
        drained = replace(hover, axes=tuple(replace(each, gain=gain * each.gain) for each in hover.axes))
        assert all(each.disk_deg > 44.5 for each in evaluate(law, drained).axes[:2])


def test_a_lag_that_is_assumed_may_be_a_delay(cpfls, folder, tmp_path):
    """A derivative makes up for a lag and not for a delay, so gains for a lag alone may not fly."""
    own = found_vehicle(commanded=False)
    path = write_vehicle(tmp_path / "speeds.h5", own, STUDY)
    words = ("tune", folder / "study.yaml", path, "--autopilot", "betaflight", "-o", tmp_path / "g.h5")
    assert "30 % either way, up to half of it a delay" in cpfls.done(*words).stderr
    autopilot, found = AUTOPILOTS["betaflight"], read(tmp_path / "g.h5")
    law = autopilot.law(autopilot.defaults() | {name: row.proposed for name, row in found.parameters.items()})
    hover = hover_plant(law, CROSS, own.model, 0.05)
    late = [replace(each, lag=0.5 * each.lag, delay=0.5 * each.lag) for each in hover.axes]
    done = evaluate(law, replace(hover, axes=(late[0], late[1], late[2])))
    assert {"roll", "pitch"} & {*found.falls_short["proposed"]} or min(done.roll.disk_deg, done.pitch.disk_deg) > 44.5


def test_a_model_that_is_no_vehicle_is_refused(refuse, folder, tmp_path):
    assert "gains need a vehicle that `cpfls vehicle` found" in " ".join(
        refuse("tune", folder / "study.yaml", folder / "study.yaml", "--autopilot", "px4", "-o", tmp_path / "g.h5")
    )


def said_of(gains):
    """Every block that is said of gains: boxes and texts first."""
    return page.blocks(loaded("tune").text(gains))


def test_each_verdict_on_margins_is_said(gains, folder):
    assert gains["px4"].exit_code == 0
    found = read(folder / "px4.h5")
    box = said_of(found)[0]
    assert (box.label, box.tone) == ("GAINS", "good")
    assert "All axes keep the asked margin (disk 45.0°) with 9 possible vehicles" in box.sentences[0]
    assert box.sentences[1].startswith("The defaults give roll ")
    before = found.sets["default"]
    unstable = replace(before.yaw.command_worst, gain_db=np.nan, phase_deg=np.nan, disk_deg=0.0)
    sets = {"proposed": replace(before, roll=replace(before.roll, plants=5)), "today": before}
    sets["today"] = replace(before, yaw=replace(before.yaw, command_worst=unstable))
    row = replace(found.parameters["MC_YAW_P"], today=2.0, clipped=True, wanted=7.0)
    other = replace(found, sets=sets, parameters={"MC_YAW_P": row}, noise=None, warnings=("take care",))
    box, warning, *_, folded, _ = said_of(other)
    assert (box.tone, warning.tone, warning.text) == ("warning", "warning", "take care")
    assert "less than the asked margin" in box.sentences[0]
    assert "with some of 5, 9 and 9 possible vehicles about roll, pitch and yaw" in box.sentences[0]
    assert box.sentences[1].startswith("Today's give roll ")
    assert box.sentences[1].endswith(", yaw unstable with some.")
    (cells,) = folded.blocks[1].cells
    assert folded.summary == "each parameter with today's value"
    assert (cells[1].tone, cells[2].text) == ("warning", "2")
    assert cells[4].text.endswith("; 7 was wanted, which the range does not hold")


LOGGED = """
import:
  time_column: IMU.timestamp
  torque_source: null
  signals:
    body_rate: {columns: [IMU.GyrX, IMU.GyrY, IMU.GyrZ], unit: rad/s}
"""


def test_a_log_gives_todays_parameters_and_the_noise(cpfls, tmp_path):
    (tmp_path / "study.yaml").write_text(STUDY + LOGGED)
    write_vehicle(tmp_path / "vehicle.h5", found_vehicle(), STUDY + LOGGED)
    rng = np.random.default_rng(1)
    line = 0.06 * np.sin(2 * np.pi * 95 * np.arange(3200) / 400)
    rates = 0.02 * rng.standard_normal((3200, 3)) + line[:, None]
    rows = [("IMU", (1_000_000 + 2500 * step, *rate)) for step, rate in enumerate(rates)]
    today = {"ATC_RAT_RLL_P": 0.2, "ATC_RAT_PIT_P": 0.1, "ATC_ANG_RLL_P": 6.0, "MOT_THST_HOVER": 0.22}
    (tmp_path / "log.bin").write_bytes(dataflash({"IMU": ("Qfff", "TimeUS,GyrX,GyrY,GyrZ")}, rows, today))
    result = cpfls.done(
        *("tune", tmp_path / "study.yaml", tmp_path / "vehicle.h5", "--autopilot", "ardupilot"),
        *("--flight", tmp_path / "log.bin", "-o", tmp_path / "gains.h5"),
    )
    found = read(tmp_path / "gains.h5")
    assert list(found.sets) == ["proposed", "today"]
    assert found.parameters["ATC_RAT_RLL_P"].today == pytest.approx(0.2)
    assert [each.hz for each in found.noise.lines] == pytest.approx([95.0], abs=1.0)
    text = (tmp_path / "gains.param").read_text()
    assert "roll rate, proportional (s): now 0.2; documented range 0.01 to 0.5" in text
    assert "INS_HNTCH_FREQ,95" in text
    assert "INS_HNTCH_ENABLE,1" in text
    # A hover thrust of another vehicle says that the full thrust is another.
    assert "if the log is right, vehicle.rotor_speed_max_rad_s is not 900" in result.output


def test_without_a_mapping_a_log_gives_parameters_alone(cpfls, folder, tmp_path):
    (tmp_path / "log.bin").write_bytes(
        dataflash({"IMU": ("Qf", "TimeUS,GyrX")}, [("IMU", (1_000_000, 0.1))], {"ATC_RAT_RLL_P": 0.2})
    )
    cpfls.done(
        *("tune", folder / "study.yaml", folder / "vehicle.h5", "--autopilot", "ardupilot"),
        *("--flight", tmp_path / "log.bin", "-o", tmp_path / "gains.h5"),
    )
    found = read(tmp_path / "gains.h5")
    assert (found.before, found.noise) == ("today", None)
    assert any("the config has no import.signals.body_rate" in words for words in found.warnings)


def test_json_is_the_summary_and_a_log_that_is_too_short_for_noise_is_said(cpfls, folder, tmp_path):
    (tmp_path / "study.yaml").write_text(STUDY + LOGGED)
    rows = [("IMU", (1_000_000 + 2500 * step, 0.1 * step, 0.2, 0.3)) for step in range(20)]
    (tmp_path / "log.bin").write_bytes(dataflash({"IMU": ("Qfff", "TimeUS,GyrX,GyrY,GyrZ")}, rows))
    result = cpfls.done(
        *("tune", tmp_path / "study.yaml", folder / "vehicle.h5", "--autopilot", "crazyflie", "--json"),
        *("--flight", tmp_path / "log.bin", "-o", tmp_path / "gains.h5"),
    )
    assert any("no log holds 256 samples" in words for words in read(tmp_path / "gains.h5").warnings)
    answer = json.loads(result.stdout)
    assert answer["parameters"]["pid_rate.roll_kp"]["proposed"] > 0
    assert answer["falls_short"]["proposed"] == []
    assert answer["file"].endswith("gains.yaml")


def test_an_imported_flight_keeps_the_parameters_of_its_log(cpfls, tmp_path):
    (tmp_path / "study.yaml").write_text(STUDY + LOGGED)
    write_vehicle(tmp_path / "vehicle.h5", found_vehicle(), STUDY + LOGGED)
    rates = 0.02 * np.random.default_rng(1).standard_normal((1600, 3))
    rows = [("IMU", (1_000_000 + 2500 * step, *rate)) for step, rate in enumerate(rates)]
    today = {"ATC_RAT_RLL_P": 0.2, "ATC_RAT_PIT_P": 0.1, "INS_HNTCH_ENABLE": 0.0}
    (tmp_path / "log.bin").write_bytes(dataflash({"IMU": ("Qfff", "TimeUS,GyrX,GyrY,GyrZ")}, rows, today))
    cpfls.done("import", tmp_path / "study.yaml", tmp_path / "log.bin", "-o", tmp_path / "flight.h5")
    cpfls.done(
        *("tune", tmp_path / "study.yaml", tmp_path / "vehicle.h5", "--autopilot", "ardupilot"),
        *("--flight", tmp_path / "flight.h5", "-o", tmp_path / "gains.h5"),
    )
    found = read(tmp_path / "gains.h5")
    assert (found.before, found.noise) == ("today", None)
    assert found.parameters["ATC_RAT_RLL_P"].today == pytest.approx(0.2)
    assert any("imported flights are low-passed" in words for words in found.warnings)
    assert any("not in the log" in words for words in found.warnings)


def test_the_file_of_ardupilot_is_read_by_a_parser_of_others(gains, folder):
    mavparm = pytest.importorskip("pymavlink.mavparm", reason="needs the package pymavlink, which reads such files")
    assert gains["ardupilot"].exit_code == 0
    read = mavparm.MAVParmDict()
    assert read.load(str(folder / "ardupilot.param"))
    assert dict(read) == pytest.approx(written(folder, "ardupilot"))
    assert (folder / "betaflight.txt").read_text().startswith("# For Betaflight 2025.12.\n")


@pytest.fixture
def looked(monkeypatch, folder):
    """A log that holds what is given: reading it and the estimate of plants have tests of their own."""

    def of(system="", changes=()):
        own = looked_flight("px4", system=system) if system else looked_flight("px4")
        plants = [looked_plant(*PLANTS["px4"], axis=axis) for axis in ("roll", "pitch", "yaw")]
        monkeypatch.setattr("cpfls_cli.stages.tune.read_flight", lambda *_: own)
        monkeypatch.setattr("cpfls_cli.stages.tune.effectiveness", lambda _: plants)
        monkeypatch.setattr("cpfls_cli.stages.tune.vibration_of", lambda _: SimpleNamespace(changes=changes))
        return save(folder / "log.csv", np.zeros((9, 2)), "t,p")

    return of


def test_a_log_alone_takes_what_it_says_of_the_autopilot(cpfls, folder, looked):
    notch, other = (
        Change(parameter=name, now=20.0, proposed=hz, reason="notch off the line")
        for name, hz in (("IMU_GYRO_NF0_FRQ", 81.0), ("another", 60.0))
    )
    log = looked(changes=(notch, other))
    answer = cpfls.summary("tune", log, "-o", folder / "looked")
    changed = written(folder, "px4", "looked")
    gains = {row["parameter"]: row["proposed"] for row in answer["changes"]}
    # What has no known range is said, and left to the pilot.
    assert changed == pytest.approx({**gains, "IMU_GYRO_NF0_FRQ": 81.0})
    assert [each["parameter"] for each in answer["filters"]] == ["IMU_GYRO_NF0_FRQ", "another"]
    assert not (folder / "looked").exists()
    again = cpfls("tune", log, "-o", folder / "looked")
    assert again.exit_code == 2
    assert "--force" in again.stderr
    for more, said in ((["--autopilot", "px4"], "leave --autopilot"), (["--seed", "1"], "reads no config")):
        refused = cpfls("tune", log, *more)
        assert refused.exit_code == 2
        assert said in refused.stderr


def test_nothing_is_written_of_a_log_whose_gains_stay(cpfls, tmp_path, looked):
    said = cpfls.done("tune", looked(system="ArduPlane 4.3"), "-o", tmp_path / "none")
    assert "not written, nothing changes" in said.stdout
    assert list(tmp_path.iterdir()) == []


def test_a_config_needs_its_vehicle(cpfls, folder):
    refused = cpfls("tune", folder / "study.yaml")
    assert refused.exit_code == 2
    assert "needs the vehicle" in refused.stderr
    assert cpfls("tune", folder / "study.yaml", folder / "vehicle.h5").exit_code == 2
