from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.look.columns import LookedLog
from cpfls_cli.look.flight import Samples
from cpfls_cli.look.look import look_at, what_is_logged
from cpfls_cli.look.reading import read_flight
from cpfls_cli.look.timeline import timeline
from tests.builders import ended_flights as ended
from tests.builders import looked_logs as logs
from tests.builders.dataflash_logs import dataflash
from tests.builders.look_flights import still_flight
from tests.builders.studies import put_file
from tests.builders.ulogs import message, ulog
from tests.builders.unknown_logs import flight, named, with_ground

OWN = flight(seconds=20.0)
HOP = with_ground(flight(seconds=20.0))
NOTHING = SimpleNamespace(counted_from_s=0.0, flown=SimpleNamespace(moments=(), air_s=()))


def read(contents):
    recognition = recognise(contents.topics, contents.units, contents.parameters, contents.system)
    given = (contents.topics, contents.units, contents.parameters, contents.system)
    return read_flight("log", *given, recognition), recognition


def events(contents, messages=()):
    found, recognition = read(contents)
    return timeline(found, contents.topics, recognition, messages)


def shown(flight, kind):
    """Give the events of a kind that signals alone show."""
    return [event for event in timeline(flight, {}, NOTHING) if event.kind == kind]


def of(found, kind):
    return [(round(event.time_s, 1), event.text) for event in found if event.kind == kind]


def state(times, **values):
    return {"timestamp": np.array(times, dtype=float)} | {
        name: np.array(own, dtype=float) for name, own in values.items()
    }


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot", "betaflight"])
def test_a_flight_between_the_ground(autopilot):
    found = events(logs.WRITERS[autopilot](HOP))
    assert {event.kind for event in found} == {"flown", "take-off", "landing"}
    (lifts,), (lands,), (flies,) = (of(found, kind) for kind in ("take-off", "landing", "flown"))
    # It stands to 5 s, flies to 25 s, and stands again; what fits leave out near the ground is flown too.
    assert abs(lifts[0] - 5.0) < 0.4
    assert abs(lands[0] - 25.0) < 0.4
    assert flies[0] == lifts[0]


def test_what_px4_states():
    more = {
        "vehicle_land_detected": state([0, 5.9, 24.2], landed=[1, 0, 1]),
        "vehicle_status": state([0, 8, 15], nav_state=[2, 3, 5], failsafe=[0, 0, 1]),
        "actuator_armed": state([0, 4.5, 27], armed=[0, 1, 0]),
    }
    found = events(logs.px4(HOP, more=more), ((3.0, "INFO", "ready"), (9.0, "WARNING", "wind")))
    on = {"actuator_armed": state([0, 27], armed=[1, 0])}
    assert of(events(logs.px4(HOP, more=on)), "armed") == [(0.0, "armed when the log begins"), (27.0, "disarmed")]
    counted = {
        "vehicle_imu_status": state([6, 7, 8], **{f"accel_clipping[{axis}]": [0, axis, axis] for axis in range(3)})
    }
    assert of(events(logs.px4(HOP, more=counted)), "clipping")[0][1].endswith("(vehicle_imu_status: y 1, z 2 times)")
    assert (of(found, "take-off"), of(found, "landing")) == ([(5.9, "takes off")], [(24.2, "lands")])
    assert of(found, "armed") == [(4.5, "armed"), (27.0, "disarmed")]
    assert of(found, "mode") == [(0.0, "mode position"), (8.0, "mode mission"), (15.0, "mode return")]
    assert (of(found, "failsafe"), of(found, "message")) == ([(15.0, "failsafe")], [(9.0, "“wind”")])
    assert [event.time_s for event in found] == sorted(event.time_s for event in found)


def test_what_ardupilot_states():
    more = {
        "MODE": state([0, 8], Mode=[0, 5], ModeNum=[0, 5]),
        "EV": state([4.5, 5.6, 24.6, 27], Id=[10, 28, 18, 11]),
        "ERR": state([10, 12], Subsys=[6, 6], ECode=[1, 0]),
        "VIBE": state([6, 7, 8, 9], Clip0=[0, 0, 3, 4], Clip1=[2, 2, 2, 2]),
    }
    result = ((0.1, "", "ArduCopter V4.5.7 (abc)"), (11.0, "", "EKF3 lane switch 1"))
    found = events(logs.ardupilot(HOP, more=more), result)
    assert of(found, "mode") == [(0.0, "mode Stabilize"), (8.0, "mode Loiter")]
    assert of(found, "take-off") == [(5.6, "takes off")]
    assert of(found, "failsafe") == [(10.0, "failsafe: battery")]
    assert of(found, "message") == [(11.0, "“EKF3 lane switch 1”")]
    assert of(found, "clipping") == [(7.0, "accelerometers clip (VIBE: Clip0 4 times)")]


def test_what_betaflight_states():
    flags = np.where(HOP.time < 4.0, 0, np.where(HOP.time < 15.0, 1, 3)).astype(float)
    phase = np.where((HOP.time > 18.0) & (HOP.time < 18.5), 1.0, 0.0)
    found = events(logs.betaflight(HOP, more={"flightModeFlags": flags, "failsafePhase": phase}))
    assert of(found, "armed") == [(4.0, "armed")]
    assert of(found, "mode") == [(0.0, "mode acro"), (15.0, "mode angle")]
    assert of(found, "failsafe") == [(18.0, "failsafe: radio lost")]


def test_modes_that_change_often_are_one_line():
    more = {"MODE": state(range(6, 16), ModeNum=[0, 5] * 5)}
    assert of(events(logs.ardupilot(HOP, more=more)), "mode") == [(6.0, "the mode changes 9 times: Stabilize, Loiter")]


def test_a_crash_shows_its_moments():
    found = events(logs.px4(ended.hits(flight(seconds=40.0))))
    assert [(kind, round(at)) for kind, at in ((e.kind, e.time_s) for e in found) if kind == "impact"] == [
        ("impact", 40)
    ]
    assert not of(found, "landing")
    assert of(found, "lies") == [(40.7, "lies on its back")]
    assert next(event for event in found if event.kind == "impact").severity == "danger"
    stops = events(logs.px4(ended.stops_in_the_air(flight(seconds=40.0))))
    assert of(stops, "rotors stop in the air") == [(40.0, "rotors stop in the air")]


def test_what_falls_against_the_air_hits_the_ground():
    falls = ended.then(flight(seconds=40.0), 1.5, felt=(0.0, 0.0, 4.5), falls=5.3)
    found = events(logs.px4(ended.then(ended.then(falls, 0.06, felt=(0.0, 40.0, 90.0)), 6.0)))
    assert [(event.kind, round(event.time_s)) for event in found if event.severity == "danger"] == [
        ("rotors stop in the air", 40),
        ("impact", 42),
    ]


def test_what_climbs_has_not_landed():
    for rate, lands in ((0.0, True), (1.2, False)):
        contents = logs.px4(OWN)
        place = contents.topics["vehicle_local_position"]
        late = np.maximum(place["timestamp"] - 15.0, 0.0)
        place["z"], place["vz"] = 0.1 * place["z"] - rate * late, 0.1 * place["vz"] - rate * (late > 0)
        motors = contents.topics["actuator_motors"]
        for name in (own for own in motors if own.startswith("control")):
            motors[name] = np.where(motors["timestamp"] > 15.0, 0.2, 1.0) * motors[name]
        assert bool(of(events(contents), "landing")) == lands


def test_a_yaw_that_is_reset_in_flight_is_said_with_its_size():
    for contents in (logs.px4(HOP), logs.WRITERS["ardupilot"](HOP)):
        resets = {"timestamp": np.array([2.0, 11.0, 12.0, 13.0]), "turn": np.radians([60.0, 4.0, -30.0, 12.0])}
        more = replace(contents, topics=contents.topics | {"yaw_resets": resets})
        # On the ground and below 10 degrees nothing comes of them.
        found = [(round(event.time_s), event.text.partition(",")[0]) for event in events(more) if event.kind == "reset"]
        assert found == [(12, "estimated yaw is reset by −30 deg"), (13, "estimated yaw is reset by 12 deg")]
        assert not [event for event in events(contents) if event.kind == "reset"]


def test_a_failsafe_on_the_ground_is_no_danger():
    for at, severity in ((1.0, "note"), (12.0, "danger")):
        more = {"vehicle_status": state([0, at, at + 0.5], nav_state=[2, 2, 2], failsafe=[0, 1, 0])}
        (event,) = [event for event in events(logs.px4(HOP, more=more)) if event.kind == "failsafe"]
        assert event.severity == severity


def test_flips_are_no_crash():
    own = ended.flips(flight(seconds=30.0))
    own.rotation = Rotation.from_euler("ZYX", own.angles[:, ::-1])
    found = events(logs.px4(own))
    assert not {"impact", "loss of control", "free fall"} & {event.kind for event in found}
    # Ten of them are one line.
    assert [text for _, text in of(found, "upside down")] == ["upside down, 10 times"]


def test_a_rotor_at_its_limit():
    contents = logs.px4(OWN)
    motors = contents.topics["actuator_motors"]
    motors["control[2]"] = np.where((OWN.time > 6.0) & (OWN.time < 6.4), 1.0, motors["control[2]"])
    (limit,) = of(events(contents), "limit")
    assert limit[1].startswith("M3 at its upper limit once, 0.38 s")
    # Pulses of 1949 and 1950 us are one limit.
    steps = contents.topics["actuator_motors"]["control[2]"].copy()
    motors["control[2]"] = np.where((steps == 1.0) & (np.arange(len(steps)) % 2 == 0), 0.999, steps)
    assert of(events(contents), "limit") == [limit]
    motors["control[2]"] = steps
    # The largest of commands that have no limit is none, nor is the crest of a climb, where all are alike.
    assert not of(events(logs.px4(OWN)), "limit")
    crest = (OWN.time > 6.0) & (OWN.time < 6.4)
    for number in range(4):
        motors[f"control[{number}]"] = np.where(crest, 0.9, np.minimum(motors[f"control[{number}]"], 0.89))
    assert not of(events(contents), "limit")
    # Where one alone stays at its largest for seconds, something limits it, as MOT_SPIN_MAX does.
    motors["control[1]"] = np.where((OWN.time > 8.0) & (OWN.time < 11.0), 0.9, motors["control[1]"])
    assert any(text.startswith("M2 at its upper limit 2 times, 3.") for _, text in of(events(contents), "limit"))


def test_a_rotor_that_oscillates_at_its_limit_is_at_it_most_of_the_time():
    time = np.arange(5000) / 500
    speeds = 0.5 + 0.1 * np.sin(3 * time)[:, None] * [1, -1, 1, -1]
    # Of ten samples seven are at the limit, for a second; then three.
    share = np.where((time > 4) & (time < 5), 7, np.where((time > 7) & (time < 8), 3, 0))
    speeds[:, 2] = np.where(np.arange(5000) % 10 < share, 1.0, speeds[:, 2])
    (limit,) = shown(still_flight(rotors=Samples(time, speeds, "rotors")), "limit")
    assert limit.text.startswith("M3 at its upper limit once, ")
    assert (limit.time_s, limit.until_s) == (pytest.approx(4.0, abs=0.03), pytest.approx(5.0, abs=0.03))


def test_clipping_gaps_and_the_battery():
    contents = logs.betaflight(OWN)
    columns = contents.topics[""]
    columns["gyroADC[0]"] = np.where((OWN.time > 6.0) & (OWN.time < 6.05), 1999.0, columns["gyroADC[0]"])
    columns["vbatLatest"] = np.where((OWN.time > 9.0) & (OWN.time < 9.6), 12.5, columns["vbatLatest"])
    kept = (OWN.time < 15.0) | (OWN.time > 15.3)
    columns.update({name: value[kept] for name, value in columns.items()})
    found = events(contents)
    assert [at for at, _ in of(found, "clipping")] == [6.0]
    ((at, text),) = of(found, "battery")
    assert at == pytest.approx(9.3, abs=0.31)
    assert text == "the battery sags to 12.5 V, from 16.0 V"
    assert [(at, text) for at, text in of(found, "gap")] == [(15.0, "no samples for 0.32 s")]
    assert not [e for e in events(logs.betaflight(OWN)) if e.kind in ("clipping", "gap", "battery")]


@pytest.mark.parametrize(("by", "said"), [(0.05, None), (0.4, "out of order there"), (9.0, "it started anew")])
def test_a_clock_that_falls_back_is_said(by, said):
    contents = logs.px4(OWN)
    for topic in contents.topics.values():
        topic["timestamp"] = topic["timestamp"] - by * (topic["timestamp"] > 12.0)
    found = of(events(contents), "restart")
    assert [at for at, _ in found] == ([] if said is None else [12.0])
    assert all(f"falls back by {by - 0.01:.3g} s" in text and text.endswith(said) for _, text in found)


def test_a_gyroscope_that_is_silent_in_flight_is_said():
    contents = logs.betaflight(OWN)
    silent = (OWN.time >= 8.0) & (OWN.time < 10.0)
    for axis in range(3):
        rate = contents.topics[""][f"gyroADC[{axis}]"]
        contents.topics[""][f"gyroADC[{axis}]"] = np.where(silent, rate[silent][0], rate)
    assert of(events(contents), "gap") == [(8.0, "the gyroscope repeats its last value for 2 s")]


def test_a_log_that_ends_in_the_air_is_said_and_who_disarms_with_the_rotors_on_may_touch_down():
    found = events(logs.px4(OWN))
    assert [text for _, text in of(found, "end")] == ["the log ends in the air"]
    assert not of(found, "landing")
    found = events(logs.betaflight(OWN, more={"flightModeFlags": (OWN.time < OWN.time[-1] - 0.05).astype(float)}))
    assert [text for _, text in of(found, "end")] == ["disarmed as it flies or touches down"]
    assert "disarmed" not in [text for _, text in of(found, "armed")]
    assert [text for _, text in of(events(logs.betaflight(OWN)), "end")] == ["the log ends in the air"]


def test_what_is_logged_and_how_fast():
    contents = logs.px4(HOP, motors=10, outputs=2)
    # Every tenth sample of the output is lost.
    output = contents.topics["vehicle_torque_setpoint"]
    kept = np.arange(len(output["timestamp"])) % 10 != 4
    output.update({name: value[kept] for name, value in output.items()})
    found, recognition = read(contents)
    log = LookedLog(contents.topics, contents.units, contents.system)
    logged = what_is_logged(found, log, recognition, 1.7e9, ("one", "two"))
    assert (logged.rotors, logged.frame, logged.system) == (4, "quad X", "PX4 1.15.0")
    assert (logged.date, logged.flown_s) == ("2023-11-14 22:13", pytest.approx(19.0, abs=0.6))
    assert logged.spans_s.shape == (1, 2)
    assert logged.voltage_begin == pytest.approx(16 - 0.01 * logged.spans_s[0, 0], abs=0.01)
    rows = {row.signal: row for row in logged.signals}
    assert rows["rotor commands"].rate_hz == pytest.approx(10.0)
    assert rows["rotor commands"].slow
    assert rows["body rate"].rate_hz == pytest.approx(100.0)
    assert not rows["body rate"].slow
    assert rows["output of the rate loop"].lost == pytest.approx(0.1, abs=0.01)
    assert rows["output of the rate loop"].longest_gap_s == pytest.approx(0.04)
    assert rows["setpoint body rate"].source == ""
    assert "SDLOG_PROFILE" in logged.faster
    assert logged.warnings == "one\ntwo"
    doubted = replace(recognition, warnings=(*recognition.warnings, "three"))
    assert what_is_logged(found, log, doubted, 1.7e9, ("one",)).warnings == "one\nthree"


def test_rate_setpoints_that_nothing_follows_are_logged():
    asked = np.random.default_rng(4).standard_normal(OWN.rate.shape)
    contents = logs.WRITERS[""](OWN)
    contents.topics[""].update(named(asked, "p_sp", "q_sp", "r_sp"))
    found, recognition = read(contents)
    assert found.unfollowed
    log = LookedLog(contents.topics, contents.units, contents.system)
    assert "setpoint body rate" not in {row.signal for row in what_is_logged(found, log, recognition, 0.0, ()).signals}
    own = look_at("log", contents.topics, contents.units, contents.parameters, contents.system)
    (loop,) = [answer for answer in own.answers if answer.question == "loop response"]
    assert (loop.answer, loop.log) == ("no", "")
    assert "does not follow what is called a rate setpoint" in loop.why


def test_pauses_are_named_where_they_leave_too_little_of_a_flight_whole():
    contents = logs.WRITERS["betaflight"](HOP)
    fields = contents.topics[""]
    kept = fields["time"] % 0.5 > 0.06
    contents.topics[""] = {name: values[kept] for name, values in fields.items()}
    own = look_at("log", contents.topics, contents.units, contents.parameters, contents.system)
    for answer in (each for each in own.answers if each.question in ("rotor balance", "hover throttle")):
        assert (answer.answer, answer.fly) == ("no", "")
        # Twice a second in 20 s of flight; what falls on the ground takes nothing of it.
        number, _, said = answer.why.partition(" ")
        assert 36 <= int(number) <= 40
        assert said == "pauses of the log leave too little of the flight whole"


@pytest.mark.parametrize(
    ("between", "named"), [((1.0, 2.0), False), ((6.0, 7.0), True)], ids=["on the ground", "aloft"]
)
def test_a_pause_is_named_where_it_takes_of_a_flight(between, named):
    contents = logs.WRITERS["betaflight"](with_ground(flight(seconds=4.0)))
    fields = contents.topics[""]
    kept = (fields["time"] < between[0]) | (fields["time"] > between[1])
    contents.topics[""] = {name: values[kept] for name, values in fields.items()}
    own = look_at("log", contents.topics, contents.units, contents.parameters, contents.system)
    (hover,) = (answer for answer in own.answers if answer.question == "hover throttle")
    said = "1 pause of the log leaves too little of the flight whole"
    assert hover.why == (said if named else "less than 12 s of hover in it")


def test_a_loop_that_is_not_measured_says_why_about_its_axes():
    contents = logs.WRITERS["betaflight"](OWN)
    rates = np.column_stack([contents.topics[""][f"gyroADC[{axis}]"] for axis in range(3)])
    contents.topics[""].update(named(rates, *(f"setpoint[{axis}]" for axis in range(3))))
    contents.topics[""].update(named(np.full_like(rates, 3.0), *(f"rcCommand[{axis}]" for axis in range(3))))
    own = look_at("log", contents.topics, contents.units, contents.parameters, contents.system)
    assert {row.signal for row in own.logged.signals} >= {"setpoint body rate"}
    (loop,) = [answer for answer in own.answers if answer.question == "loop response"]
    assert loop.answer == "no"
    assert "stick" in loop.why


def test_readers_give_messages(tmp_path):
    rows = [("MSG", (2_000_000, b"Mode change")), ("X", (1_000_000, 1.0)), ("X", (3_000_000, 2.0))]
    path = put_file(tmp_path / "log.bin", dataflash({"X": ("Qf", "TimeUS,A")}, rows))
    assert log_contents(path).messages == ((1.0, "", "Mode change"),)
    path = tmp_path / "log.ulg"
    said = b"\x34" + (3_600_000_000 + 1_500_000).to_bytes(8, "little") + b"\x1b[31mLow battery\x1b[0m\t"
    path.write_bytes(
        ulog([(0, 0, [1.0]), (10_000, 0, [2.0])], {"x": "uint64_t timestamp;float a"}) + message("L", said)
    )
    assert log_contents(path).messages == ((1.5, "WARNING", "Low battery"),)


def test_a_hard_landing():
    own = with_ground(flight(seconds=20.0))
    own.specific_force[np.abs(own.time - 25.1) < 0.02] = [0.0, 0.0, 60.0]
    assert [(event.text, event.severity) for event in events(logs.ardupilot(own)) if event.kind == "landing"] == [
        ("lands hard, with 6.1 g", "warning")
    ]
    # The autopilot is sure of it later, and it is when it touches that counts.
    late = logs.ardupilot(own, more={"EV": state([27.0], Id=[18])})
    assert of(events(late), "landing") == [(25.1, "lands hard, with 6.1 g")]
    # What stops hard has landed, whatever the climb rate of an estimator that drifts away says.
    drifting = logs.ardupilot(own)
    drifting.topics["XKF1"]["VD"] += 5.0
    assert of(events(drifting), "landing") == [(25.1, "lands hard, with 6.1 g")]


def test_the_autopilots_word_for_landing_may_come_long_after():
    """A flight is near the ground at a tenth of its height, and may go down from there slowly."""
    sinks = ended.then(with_ground(flight(seconds=20.0), after_s=0.0), 8.0, rotors=0.9, roll=0.0)
    low = ended.then(ended.then(sinks, 0.04, rotors=0.5, felt=(0.0, 0.0, 60.0)), 6.0)
    low.position[:, 2] = np.interp(low.time, [5.0, 6.0, 25.0, 26.0, 33.0], [0.0, 20.0, 20.0, 1.5, 0.0])
    stated = logs.ardupilot(low, more={"EV": state([33.5], Id=[18])})
    assert of(events(stated), "landing") == [(33.0, "lands hard, with 6.1 g")]


def test_a_force_that_its_rotors_made_before_is_no_hard_landing():
    own = with_ground(flight(seconds=20.0))
    for at in (10.0, 14.0, 25.1):
        own.specific_force[np.abs(own.time - at) < 0.02] = [0.0, 0.0, 60.0]
    assert [text for _, text in of(events(logs.ardupilot(own)), "landing")] == ["lands"]


def test_what_tips_over_long_after_it_landed():
    tipped = ended.then(HOP, 5.0, felt=ended.UPSIDE_DOWN, roll=np.pi)
    (begin, text), *more = of(events(logs.ardupilot(tipped)), "lies")
    assert (round(begin), text, more) == (round(HOP.time[-1]), "lies on its back", [])
    # Turned over by its attitude, and upright by its weight, it has not moved.
    assert not of(events(logs.ardupilot(ended.then(HOP, 5.0, roll=np.pi))), "lies")


def test_an_accelerometer_that_reads_wrong_shows_no_hover():
    own = flight(seconds=20.0)
    own.specific_force[0] = [0.0, 0.0, 9.80665]
    assert read(logs.ardupilot(with_ground(own)))[0].reads_at_rest == pytest.approx(1.0, abs=0.01)
    own.specific_force = 0.79 * own.specific_force
    contents = logs.ardupilot(with_ground(own))
    assert [text for _, text in of(events(contents), "calibration")] == [
        "the accelerometer reads 0.79 g at rest: calibrate it"
    ]
    assert not np.isfinite(read(contents)[0].specific_force).any()


@pytest.mark.parametrize(("size", "said"), [(1.28, ["1.28"]), (1.05, []), (0.8, ["0.80"])])
def test_an_accelerometer_that_reads_wrong_in_a_log_that_never_stands(size, said):
    own = still_flight(20.0, specific_force=np.tile([0.0, 0.0, -9.80665 * size], (1000, 1)))
    texts = [event.text for event in shown(own, "calibration")]
    assert texts == [f"the accelerometer reads {each} g in steady flight: calibrate it" for each in said]
    # What leans or turns may be pushed by its rotors, and of a short flight nothing is known.
    lively = own.body_rate + np.sin(own.time)[:, None]
    leaning = replace(own, attitude=own.attitude + np.array([0.0, 0.4, 0.0]))
    for each in (replace(own, body_rate=lively), leaning, replace(own, usable=own.time < 10.0)):
        assert not shown(each, "calibration")


def test_the_autopilots_word_for_take_off_may_come_long_before():
    """A flight is surely off the ground at a tenth of its height."""
    assert of(events(logs.ardupilot(HOP, more={"EV": state([1.0], Id=[28])})), "take-off") == [(1.0, "takes off")]


def test_errors_that_come_again_are_one_line_and_a_crash_is_no_note():
    more = {"ERR": state([8, 12, 16], Subsys=[25, 25, 12], ECode=[1, 1, 1])}
    found = [event for event in events(logs.ardupilot(HOP, more=more)) if event.kind == "error"]
    assert [(event.text.partition(":")[0], event.text[-7:], event.severity) for event in found] == [
        ("thrust loss", "2 times", "danger"),
        ("crash check", "crashed", "danger"),
    ]


def test_a_rotor_that_is_steady_where_nothing_moves_is_at_no_limit():
    speeds = np.full((3000, 4), 0.4)
    speeds[:, 1:3] = 0.45
    still = still_flight(rotors=Samples(np.arange(3000) / 50, speeds, "rotors"))
    assert not shown(still, "limit")
    moving = np.where(np.arange(4) == 1, 0.45, 0.4 + 0.02 * np.sin(np.arange(3000) / 50)[:, None])
    assert shown(replace(still, rotors=Samples(np.arange(3000) / 50, moving, "rotors")), "limit")
