"""Blackbox logs of every encoding, whole and broken."""

import csv
import struct

import numpy as np
import pytest

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import log_contents, log_flights
from tests.builders.blackbox_logs import (
    BATTERY,
    BEEP,
    END,
    FACTS,
    FIELDS,
    NAMES,
    PRODUCT,
    RESUMED,
    SLOW,
    flight,
    frames,
    header,
    signed,
    three,
    unsigned,
)

NAME = "LOG00001.TXT"


FACTORS = {"gyroADC[0]": 1.0, "accSmooth[2]": 1 / 2048, "vbatLatest": 0.01, "eRPM[0]": 200 / 14}


def held(contents, rows):
    columns = contents.topics[""]
    stamps = rows[:, 1] + (1 << 32) * (np.arange(len(rows)) >= np.argmax(np.diff(rows[:, 1], prepend=0) < 0))
    stamps = stamps if (np.diff(rows[:, 1]) < 0).any() else rows[:, 1]
    np.testing.assert_allclose(columns["time"], 1e-6 * (stamps - stamps[0]), atol=1e-12)
    for place, name in enumerate(NAMES[2:], start=2):
        own = columns[name.replace("eRPM", "rpm")]
        np.testing.assert_allclose(own, FACTORS.get(name, 1.0) * rows[:, place], rtol=1e-12, err_msg=name)


@pytest.mark.parametrize("seed", range(4))
def test_every_encoding_and_prediction_comes_back(read, seed):
    rows = flight(seed=seed)
    parts = frames(rows)
    contents = read(header() + b"".join([*parts[:3], SLOW, BEEP, *parts[3:], END]))
    held(contents, rows)
    assert contents.warnings == ()


def test_frames_are_as_long_as_their_fields_are_many(read):
    names = ",".join(["loopIteration", "time", *(f"debug[{number}]" for number in range(300))])
    ways = {f"Field {kind} {what}": ",".join(["0"] * 302) for kind in "IP" for what in ("predictor", "encoding")}
    content = header(**{"Field I name": names, "Field I signed": ",".join(["1"] * 302), **ways})
    for row in range(20):
        content += b"I" + b"".join(signed(value) for value in (row, 1000 * row, *range(1000, 1300)))
    contents = read(content + END)
    assert contents.warnings == ()
    np.testing.assert_allclose(contents.topics[""]["debug[299]"], np.full(20, 1299.0))


def test_units_parameters_and_program(read):
    contents = read(header() + b"".join(frames(flight())))
    assert contents.units == {
        "time": "s",
        "gyroADC[0]": "deg/s",
        "accSmooth[2]": "g",
        "vbatLatest": "V",
        "rpm[0]": "rpm",
    }
    assert contents.system == FACTS["Firmware revision"]
    assert (contents.parameters["minthrottle"], contents.parameters["motorOutput"]) == (1070.0, "158,2047")
    assert not {"Product", "Field I name", "I interval"} & contents.parameters.keys()


def renamed(content, **names):
    """A log that has other names for some of its fields."""
    for old, new in names.items():
        content = content.replace(f"{old[:-1]}[{old[-1]}]".encode(), new.encode())
    return content


def test_a_log_of_high_resolution_has_tenths(read):
    rows = flight()
    content = header(blackbox_high_resolution="1") + b"".join(frames(rows))
    columns = read(renamed(content, axisI1="setpoint[1]")).topics[""]
    for name, place in (("gyroADC[0]", "gyroADC[0]"), ("setpoint[1]", "axisI[1]")):
        np.testing.assert_allclose(columns[name], 0.1 * rows[:, NAMES.index(place)])
    # Sticks and throttle too.
    np.testing.assert_allclose(columns["rcCommand[3]"], 0.1 * rows[:, NAMES.index("rcCommand[3]")])
    # What is no angular rate is as it was.
    np.testing.assert_allclose(columns["accSmooth[2]"], rows[:, NAMES.index("accSmooth[2]")] / 2048)


def test_the_real_part_of_an_attitude_is_what_is_left(read):
    rows = flight()
    rows[:, NAMES.index("axisI[0]")] = np.linspace(-20_000, 20_000, len(rows))
    rows[:, NAMES.index("axisI[1]")] = 10_000
    rows[:, NAMES.index("axisI[2]")] = 0
    content = header() + b"".join(frames(rows))
    contents = read(renamed(content, axisI0="imuQuaternion[0]", axisI1="imuQuaternion[1]", axisI2="imuQuaternion[2]"))
    quaternion = np.column_stack([contents.topics[""][f"imuQuaternion[{part}]"] for part in ("w", 0, 1, 2)])
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=1), 1.0)
    np.testing.assert_allclose(quaternion[0, 1:], [-20_000 / 32_767, 10_000 / 32_767, 0.0])
    assert quaternion[:, 0].min() > 0
    assert contents.units["imuQuaternion[w]"] == "1"


def test_older_and_other_programs_have_other_units(read):
    def factors(revision, gyro_scale, name="gyro_scale"):
        rows = flight()
        scale = f"0x{struct.pack('>f', gyro_scale).hex()}"
        changes = {"Firmware revision": revision, "gyro_scale": None, name: scale, "motor_poles": None}
        columns = read(header(**changes) + b"".join(frames(rows))).topics[""]
        assert "rpm[0]" not in columns
        return [columns[name][3] / rows[3, NAMES.index(name)] for name in ("gyroADC[0]", "vbatLatest")]

    assert factors("Betaflight 3.1.5 (4646f9d) OMNIBUSF4", 1.0) == pytest.approx([1.0, 0.1])
    radians = np.deg2rad(1 / 16.4)
    assert factors("INAV 2.6.1 (2d5d3b1) MATEKF405", 1e-6 * radians) == pytest.approx([1 / 16.4, 0.01])
    assert factors("Betaflight 3.0.0 (ea67304) MOTOLAB", 1 / 16.4, "gyro.scale")[0] == pytest.approx(1 / 16.4)
    assert factors("Cleanflight 2.0", 1e-6 * radians) == pytest.approx([1 / 16.4, 1.0])


def test_a_fork_of_betaflight_under_a_name_of_its_own_is_its_kin(read):
    def written_by(revision, **more):
        return read(header(**{"Firmware revision": revision, **more}) + b"".join(frames(flight())))

    name = "Otherflight 4.3.4 (norevision)"
    # A parameter that no other firmware has.
    contents = written_by(name, pid_process_denom="4")
    assert contents.system == f"Betaflight, as {name}"
    assert written_by(name).system == name
    for unknown in ("", "Otherflight", "Other-Flight 4.3.4 (x)"):
        assert written_by(unknown, pid_process_denom="4").system == unknown
    assert not AUTOPILOTS["betaflight"].firmware.wrote(contents.system)


def test_a_firmware_that_states_a_commit_alone_is_called_by_its_type(read):
    changes = {"Firmware revision": "747971f", "Firmware type": "Cleanflight"}
    assert read(header(**changes) + b"".join(frames(flight()))).system == "Cleanflight 747971f"


def test_what_is_broken_costs_the_frames_up_to_the_next_whole_one(read):
    rows = flight()
    parts = frames(rows)
    parts[11] = parts[11][:1] + b"\xff" * 9
    contents = read(header() + b"".join(parts))
    held(contents, np.delete(rows, range(11, 16), axis=0))
    assert contents.warnings == ("1 frames are broken; everything up to the next whole frame is missing",)


def test_slow_fields_behind_a_fault_are_not_believed(read):
    parts = frames(flight())
    whole = read(header() + b"".join([*parts[:3], SLOW, *parts[3:]])).topics[""]
    parts[11] = parts[11][:1] + b"\xff" * 9 + b"S" + unsigned(1) + three([0, 2, 0])
    broken = read(header() + b"".join([*parts[:3], SLOW, *parts[3:]])).topics[""]
    for name in ("flags", "phase"):
        assert set(broken[name]) == set(whole[name])


def test_a_stray_letter_of_frames_that_the_log_has_none_of_is_no_frame(read):
    whole = [part for part in frames(flight()) if part[:1] == b"I"]
    named = b"\n".join(line for line in header().split(b"\n") if not line.startswith(b"H Field P"))
    topic = read(named + whole[0] + b"P" + b"".join(whole)).topics[""]
    assert {len(column) for column in topic.values()} == {len(whole)}


def test_a_jump_in_time_is_a_broken_frame_unless_the_recorder_paused(read):
    rows = flight(begin_us=1_000_000)
    rows[32:, 1] += 30_000_000
    parts = frames(rows)
    contents = read(header() + b"".join(parts))
    held(contents, np.delete(rows, range(32, 40), axis=0))
    assert contents.warnings == ("1 frames are broken; everything up to the next whole frame is missing",)
    held(read(header() + b"".join([*parts[:32], RESUMED, *parts[32:]])), rows)


def test_a_log_that_was_cut_off_is_read_up_to_there(read):
    rows = flight()
    contents = read(header() + b"".join(frames(rows))[:-5])
    held(contents, rows[:-1])
    assert contents.warnings == ()


def test_of_several_flights_the_longest_is_read(read):
    short, long = flight(16), flight(40, seed=2)
    files = [header() + b"".join([*frames(rows), END]) for rows in (short, long, short)]
    contents = read(b"".join(files))
    held(contents, long)
    assert contents.warnings == ("holds 3 flights; the longest, number 2, is read: 0 s; `cpfls look` looks at each",)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (header(), "a blackbox log without readable frames"),
        (header() + bytes(500), "a blackbox log without readable frames"),
        (header()[:100], "a broken blackbox log: its header lacks the line 'Field I name'"),
        (header(**{"Data version": "1"}), "a broken blackbox log: its header: Data version 1, not 2"),
        (header(**{"Field I signed": "0,1"}), "a broken blackbox log: its header: "),
        (header(**{"Field P encoding": ",".join("5" * len(FIELDS))}), "its header: fields of kind P in the encoding 5"),
        (header(**{"Field I name": "loopIteration,tim"}), "its header: the second field is not time"),
        (
            header(**{"Field I encoding": None}) + b"".join(frames(flight())),
            "a broken blackbox log: its header lacks the line 'Field I encoding'",
        ),
        (header(gyro_scale="one") + b"".join(frames(flight())), "a broken blackbox log: its header: "),
    ],
    ids=["header", "zeros", "cut", "version", "count", "encoding", "time", "none", "scale"],
)
def test_what_is_no_log(read, content, message):
    with pytest.raises(InputError) as caught:
        read(content)
    assert message in str(caught.value)


def test_stamps_of_damaged_frames_do_not_shift_the_others(read):
    rows = flight(begin_us=1_000_000)
    rows[17, 1] += 900_000
    contents = read(header() + b"".join(frames(rows)))
    # The two whole frames after it are taken for steps back.
    held(contents, np.delete(rows, range(17, 32), axis=0))
    assert contents.warnings == ("2 frames are broken; everything up to the next whole frame is missing",)


def test_volts_are_in_the_unit_of_a_cell(read):
    def factor(revision, cells, reference):
        rows = flight()
        place = NAMES.index("vbatLatest")
        changes = {"Firmware revision": revision, "vbatcellvoltage": cells, "vbatref": str(reference)}
        # Frames hold the difference to the reference.
        read_as = rows[3, place] - BATTERY + reference
        return read(header(**changes) + b"".join(frames(rows))).topics[""]["vbatLatest"][3] / read_as

    assert factor("Betaflight 3.0.1 (48b7b4f) X", "33,35,43", 163) == pytest.approx(0.1)
    assert factor("Cleanflight 2.5.0 (08348b705) X", "33,35,43", 151) == pytest.approx(0.1)
    assert factor("Betaflight 4.3.1 (8d4f005) X", "330,350,430", 1667) == pytest.approx(0.01)
    # The converter's numbers, of which no header gives the scale.
    assert factor("bdaf8ec", "33,35,43", 1840) == 1


def test_each_flight_of_a_file_is_read(tmp_path):
    path, made = tmp_path / "dump.bbl", [flight(16), flight(40, seed=2)]
    path.write_bytes(b"".join(header() + b"".join([*frames(rows), END]) for rows in made) + header())
    for contents, rows in zip(log_flights(path), made, strict=True):
        held(contents, rows)


def test_a_date_to_come_is_none(read):
    dated = [
        read(header(**{"Log start datetime": f"{year}-06-28T01:04:00.000+00:00"}) + b"".join(frames(flight())))
        for year in (2025, 2091)
    ]
    assert [np.isfinite(own.flown_at) for own in dated] == [True, False]


def test_what_the_log_viewer_exports_is_read_as_the_log(read, tmp_path):
    rows = flight(begin_us=1_000_000)
    facts = {"vbatcellvoltage": "330,350,430", "rollPID": "45,80,30", "pitchPID": "47,84,34", "yawPID": "45,80,0"}
    log = read(header(**facts, d_min="40,46,0") + b"".join([*frames(rows), END]))
    lines = {
        **{name: FACTS[name] for name in ("Firmware revision", "motorOutput", "acc_1G", "vbatref", "motor_poles")},
        "gyroScale": "1.7453292519943295e-8",
        "vbatmincellvoltage": "330",
        "vbatwarningcellvoltage": "350",
        "vbatmaxcellvoltage": "430",
        "rollPID": "45,80,30,40,120",
        "pitchPID": "47,84,34,46,125",
        "yawPID": "45,80,0,,120",
        "pidSumLimit": "500",
    }
    text = f'"Product","{PRODUCT}"\n' + "".join(f'"{name}","{value}"\n' for name, value in lines.items())
    # What is logged as it changes is no number before it first does; the heading is the viewer's.
    text += ",".join(f'"{name}"' for name in (*NAMES, "flightModeFlags", "heading[0]")) + "\n"
    for number, row in enumerate(rows.tolist()):
        text += ",".join(map(str, [*row, "NaN" if number < 3 else 1, 0.25])) + "\n"
    exported = read(text, "log.bbl.csv")
    for name, values in log.topics[""].items():
        np.testing.assert_allclose(exported.topics[""][name], values, rtol=1e-6, atol=1e-9, err_msg=name)
    assert exported.topics[""]["flightModeFlags"].tolist() == [1.0] * len(rows)
    assert (exported.units, exported.system) == (log.units, log.system)
    # Some viewers write more of what they compute than they name.
    head, values = text[: text.index('"loopIteration"')], text[text.index('"loopIteration"') :].splitlines()
    longer = read(head + "\n".join([values[0], *(f"{line},0.5,NaN" for line in values[1:])]) + "\n", "more.bbl.csv")
    for name, own in exported.topics[""].items():
        np.testing.assert_array_equal(longer.topics[""][name], own)
    # A spreadsheet drops quotes that it does not need, and fills each line; of much of Europe with semicolons.
    width = len(NAMES) + 2
    filled = [next(csv.reader([line])) for line in text.splitlines()]
    for delimiter in ",;":
        with (tmp_path / "saved.csv").open("w", newline="") as file:
            csv.writer(file, delimiter=delimiter).writerows([*own, *[""] * (width - len(own))] for own in filled)
        saved = log_contents(tmp_path / "saved.csv")
        assert (saved.parameters, saved.units) == (exported.parameters, exported.units)
        for name, values in exported.topics[""].items():
            np.testing.assert_array_equal(saved.topics[""][name], values)
    alike = {"motorOutput", "rollPID", "pitchPID", "d_min", "vbatcellvoltage"}
    assert {name: exported.parameters[name] for name in alike} == {name: log.parameters[name] for name in alike}
    assert exported.parameters["pidsum_limit"] == 500.0


@pytest.mark.parametrize(
    ("line", "names", "what"),
    [
        ('"gyroScale","fast"', "loopIteration,time,motor[0]", "its header: could not convert"),
        ('"acc_1G",2048', "frame,time,motor[0]", "no columns loopIteration and time"),
    ],
)
def test_an_export_that_is_broken_is_refused(tmp_path, line, names, what):
    rows = "".join(f"{row},{1000 * row},{row % 3}\n" for row in range(40))
    (tmp_path / "log.csv").write_text(f'"Product","{PRODUCT}"\n{line}\n{names}\n{rows}')
    with pytest.raises(InputError, match=rf"log\.csv: a broken export of a blackbox log: .*{what}"):
        log_contents(tmp_path / "log.csv")


def test_what_an_export_never_knows_is_no_column(read):
    rows = "".join(f"{row},{1000 * row},{row % 3},NaN\n" for row in range(40))
    text = f'"Product","{PRODUCT}"\n"acc_1G",2048\nloopIteration,time,motor[0],flightModeFlags\n{rows}'
    assert read(text, "log.csv").topics[""].keys() == {"time", "motor[0]"}


def test_rows_that_an_export_holds_twice_are_said_and_nothing_is_called_missing(read):
    rows = "".join((1 + (row % 10 == 0)) * f"{row},{1000 * row},{row % 3}\n" for row in range(40))
    contents = read(f'"Product","{PRODUCT}"\n"acc_1G",2048\nloopIteration,time,motor[0]\n{rows}', "log.csv")
    assert contents.topics[""]["motor[0]"].tolist() == [float(row % 3) for row in range(40)]
    assert contents.warnings == ("4 rows repeat the stamp of the one before: the first of each is used",)
