"""Logs of ArduPilot, written byte by byte, whole, broken and cut off."""

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from tests.builders.dataflash_logs import HEAD, dataflash

KINDS = {
    "IMU": ("QBff", "TimeUS,I,GyrX,AccX"),
    "ATT": ("QccCZ", "TimeUS,DesRoll,Roll,Yaw,Note"),
    "OLD": ("IhL", "TimeMS,Value,Lat"),
    "HALF": ("QgdBM", "TimeUS,Half,Double,Count,Mode"),
    "FILE": ("Nf", "Name,Size"),
}
UNITS = {"IMU": ("s#Eo", "F---"), "ATT": ("sddd-", "FBBB-")}
ROWS = [
    ("IMU", (5_000_000, 0, 0.5, 9.5)),
    ("IMU", (5_000_100, 1, 0.25, 9.25)),
    ("ATT", (5_004_000, -1250, 325, 35999, b"text")),
    ("OLD", (5_006, -7, -353_632_621)),
    ("HALF", (5_007_000, 0.5, 1e-300, 200, 5)),
    ("FILE", (b"a", 1.0)),
    ("IMU", (5_010_000, 0, 0.75, 9.75)),
]
PARAMETERS = {"FRAME_CLASS": 1.0, "MOT_THST_EXPO": 0.5}


def log(rows=ROWS, units=UNITS, said=("ArduCopter V4.5.7 (2a3dc4b7)",), *, text=False):
    return dataflash(KINDS, rows, PARAMETERS, said, units, text=text)


NAME = "log.bin"


def test_messages_become_topics_and_instances_topics_of_their_own(read):
    contents = read(log())
    listed = {name: {each: values.tolist() for each, values in own.items()} for name, own in contents.topics.items()}
    # Seconds from the first stamp of all, those of PARM, MSG, UNIT and FMTU at 1 microsecond among them.
    assert listed["IMU"] == {"timestamp": [4.999999, 5.009999], "I": [0, 0], "GyrX": [0.5, 0.75], "AccX": [9.5, 9.75]}
    assert listed["IMU[1]"] == {"timestamp": [5.000099], "I": [1], "GyrX": [0.25], "AccX": [9.25]}
    assert listed["ATT"] == {"timestamp": [5.003999], "DesRoll": [-12.5], "Roll": [3.25], "Yaw": [359.99]}
    assert listed["OLD"] == {"timestamp": [5.005999], "Value": [-7], "Lat": [pytest.approx(-35.3632621, abs=1e-12)]}
    assert listed["HALF"] == {"timestamp": [5.006999], "Half": [0.5], "Double": [1e-300], "Count": [200], "Mode": [5]}
    assert "FILE" not in listed
    assert contents.warnings == ()


def test_what_the_log_says_of_units_parameters_and_program(read):
    contents = read(log())
    units = {"GyrX": "rad/s", "AccX": "m/s^2"}
    assert {name: unit for name, unit in contents.units.items() if name.startswith(("IMU", "ATT"))} == (
        {f"IMU.{name}": unit for name, unit in units.items()}
        | {f"IMU[1].{name}": unit for name, unit in units.items()}
        | {f"ATT.{name}": "deg" for name in ("DesRoll", "Roll", "Yaw")}
    )
    assert contents.parameters == PARAMETERS
    assert contents.system == "ArduCopter 4.5.7"
    old = read(log(units=None, said=("PX4: de6b667d", "APM:Copter V3.4.4-rc1 (65ffe9d7)")))
    assert (old.system, old.units) == ("ArduCopter 3.4.4", {})
    # What does not say its instances is one topic.
    assert old.topics["IMU"]["I"].tolist() == [0, 1, 0]
    assert read(log(said=())).system == ""


def test_a_parameter_that_is_changed_in_flight_counts_as_it_was_at_the_beginning(read):
    assert read(log([*ROWS, ("PARM", (9_000_000, b"FRAME_CLASS", 7.0))])).parameters == PARAMETERS


def test_a_log_that_was_cut_off_is_read_up_to_there(read):
    contents = read(log()[:-5])
    assert contents.topics["IMU"]["GyrX"].tolist() == [0.5]
    assert contents.warnings == ()


def test_bytes_that_are_lost_or_strange_are_warned_of_and_cost_the_message_before_at_most(read):
    whole = log()
    place = whole.rindex(HEAD, 0, whole.rindex(HEAD))
    for broken, lost in (
        (whole[:place] + bytes(40) + HEAD + b"\xee" + whole[place:], 43 + 23),
        (whole[: place - 9] + whole[place:], 14),
    ):
        contents = read(broken)
        assert contents.topics["IMU"]["GyrX"].tolist() == [0.5, 0.75]
        (warning,) = contents.warnings
        assert warning.startswith(f"{lost} bytes belong to no message: the file is damaged in places")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "an empty file: nothing was logged, or the copy failed"),
        (
            bytes(range(256)),
            "not a DataFlash log: it does not start like one (encrypted, or of another kind?); a table with a line of"
            " column names has to end in .csv",
        ),
        (b"t,roll\n0,1\n", "seems to hold CSV, unlike the ending of its name; rename it to end in .csv"),
        (log()[:60], "holds no messages with time stamps (TimeUS)"),
        (dataflash({}, []), "holds no messages with time stamps (TimeUS)"),
    ],
    ids=["empty", "noise", "text", "cut", "none"],
)
def test_what_is_no_log(read, content, message):
    with pytest.raises(InputError) as caught:
        read(content)
    assert str(caught.value).endswith(f"log.bin: {message}")


def test_kinds_of_other_fields_than_usual_tell_nothing_of_the_vehicle(read):
    kinds = {"MSG": ("QZ", "TimeUS,Mess"), "PARM": ("QNZ", "TimeUS,Name,Value"), "UNIT": ("Qbf", "TimeUS,Id,Label")}
    rows = [("MSG", (1, b"ArduCopter V4.5.7")), ("PARM", (1, b"A", b"x")), ("UNIT", (1, 100, 1.0)), *ROWS]
    contents = read(dataflash(KINDS | kinds, rows))
    assert (contents.system, contents.parameters, contents.units) == ("", {}, {})
    assert "IMU" in contents.topics


def test_kinds_that_contradict_themselves_are_left_out(read):
    kinds = KINDS | {
        "BAD1": ("Qf", "TimeUS,A,B"),
        "BAD2": ("QX", "TimeUS,A"),
        "BAD3": ("Qff", "TimeUS,A,A"),
        "BAD4": ("Qff", "TimeUS,,A"),
    }
    rows = [*ROWS, ("BAD4", (1_000_000, 1.0, 2.0))]
    content = dataflash({name: own for name, own in kinds.items() if name != "BAD2"}, rows)
    assert not {name for name in read(content).topics if name.startswith("BAD")}
    assert np.isfinite(read(content).topics["IMU"]["GyrX"]).all()


def test_a_field_may_have_any_name(read):
    content = dataflash({"OWN": ("Qf", "TimeUS,f0")}, [("OWN", (1_000_000, 1.5))])
    assert read(content).topics["OWN"]["f0"].tolist() == [1.5]


def test_a_log_in_text_holds_the_same(read):
    as_bytes, as_text = read(log()), read(log(text=True, said=("ArduCopter V4.5.7 (2a3dc4b7), on the ground",)))
    assert as_text.topics.keys() == as_bytes.topics.keys()
    for topic, fields in as_bytes.topics.items():
        # A mode has a name there.
        kept = fields.keys() - {"Mode"}
        assert as_text.topics[topic].keys() == kept
        for name in kept:
            np.testing.assert_allclose(as_text.topics[topic][name], fields[name], rtol=1e-9)
    assert as_text.units == {name: unit for name, unit in as_bytes.units.items() if name.partition(".")[2] != "Mode"}
    assert (as_text.parameters, as_text.system, as_text.warnings) == (as_bytes.parameters, as_bytes.system, ())


def test_broken_lines_of_text_are_counted_and_left_out(read):
    whole = log(text=True)
    broken = (
        whole.replace(b"IMU, 5000000, 0, 0.5, 9.5", b"IMU, 5000000, 0, 0.5").replace(b", 0.75,", b", 0.7x,") + b"IMU, 5"
    )
    contents = read(broken)
    assert "IMU" not in contents.topics
    assert "IMU[1]" in contents.topics
    assert contents.warnings[0].endswith("the file is damaged in places; what could be read is used")


OLD = {
    "IMU": ("If", "TimeMS,GyrX"),
    "GPS": ("BIHI", "Status,TimeMS,Week,T"),
    "EV": ("B", "Id"),
    "MSG": ("Z", "Message"),
    "PARM": ("Nf", "Name,Value"),
}


@pytest.mark.parametrize("text", [False, True])
def test_old_events_are_stamped_as_what_comes_before_them(read, text):
    rows = [
        ("IMU", (5_000, 0.5)),
        ("EV", (10,)),
        ("IMU", (5_100, 0.5)),
        ("GPS", (3, 403_392_200, 1817, 5_150)),
        ("EV", (11,)),
        ("MSG", (b"ArduCopter V3.2.1",)),
        ("IMU", (5_200, 0.5)),
    ]
    contents = read(dataflash(OLD, rows, text=text))
    assert contents.topics["EV"]["timestamp"].tolist() == [0.0, 0.15]
    assert contents.messages == ((0.15, "", "ArduCopter V3.2.1"),)
    # Of GPS the time of its week makes a date, and the log's own clock a stamp.
    assert contents.topics["GPS"]["timestamp"].tolist() == [0.15]
    assert contents.flown_at == pytest.approx(315_964_782 + 604_800 * 1817 + 403_392.2 - 0.15, abs=0.01)


@pytest.mark.parametrize(("text", "before"), [(False, b"\xa5" * 64), (True, b"58\r\n\r\nArduCopter V3.0.1\r\n")])
def test_a_log_may_begin_late(read, text, before):
    late, whole = read(before + log(text=text)), read(log(text=text))
    assert late.topics.keys() == whole.topics.keys()
    assert len(late.warnings) == (not text)


@pytest.mark.parametrize("more", [[], [("GPS", (3, 1, 1817, 2))]])
def test_attitudes_without_stamps(read, more):
    kinds = {"ATT": ("cc", "RollIn,Roll"), "EV": OLD["EV"], "GPS": OLD["GPS"], "PARM": OLD["PARM"], "MSG": OLD["MSG"]}
    with pytest.raises(InputError, match="have no time stamps, as ArduCopter to 3"):
        read(dataflash(kinds, [("ATT", (1, 2)), ("EV", (10,)), *more]))


def messages_of(contents):
    return {(topic, each): values.tolist() for topic, own in contents.topics.items() for each, values in own.items()}


@pytest.mark.parametrize("form", ["structures", "matrices"])
def test_messages_that_a_ground_station_made_variables_of_matlab_are_those_of_the_log(read, form):
    kinds = {"IMU": ("QBff", "TimeUS,I,GyrX,AccX"), "ATT": ("Qcc", "TimeUS,Roll,Yaw"), "RCOU": ("QHH", "TimeUS,C1,C2")}
    own = {
        "IMU": [(5_000_000 + 1000 * row, row % 2, 0.5 * row, 9.5) for row in range(6)],
        "ATT": [(5_000_500 + 2000 * row, 100 * row, -250) for row in range(3)],
        "RCOU": [(5_000_700 + 2000 * row, 1100 + row, 1200) for row in range(3)],
    }
    rows = sorted(((name, values) for name, every in own.items() for values in every), key=lambda own: own[1][0])
    log = read(dataflash(kinds, rows, {"FRAME_CLASS": 1.0}, ("ArduCopter V4.5.7",), {"IMU": ("s#Eo", "F---")}))
    data = {}
    for name, every in own.items():
        fields, letters = kinds[name][1].split(","), kinds[name][0]
        table = np.array(every, dtype=float) * [0.01 if letter == "c" else 1.0 for letter in letters]
        if form == "structures":
            whole = [letter in "QBH" for letter in letters]
            data[name] = {
                each: column.astype(int) if kept else column
                for each, column, kept in zip(fields, table.T, whole, strict=True)
            }
        else:
            data[f"{name}_label"] = np.array(fields, dtype=object)
            parts = (
                {f"{name}_{number}": table[table[:, 1] == number] for number in (0, 1)}
                if name == "IMU"
                else {name: table}
            )
            data |= parts
    if form == "structures":
        data["PARM"] = {
            "TimeUS": np.array([1, 1]),
            "Name": np.array(["FRAME_CLASS  ", "FRAME_TYPE "], dtype=object),
            "Value": np.array([1.0, 3.0]),
        }
        data["MSG"] = {"TimeUS": 1, "Message": "ArduCopter V4.5.7"}
    exported = read(data, "log.mat")
    held = {
        key: values
        for key, values in messages_of(log).items()
        if key[1] != "timestamp" and key[0] in own | {"IMU[1]": 0}
    }
    assert {key: pytest.approx(values) for key, values in held.items()} == {
        key: values for key, values in messages_of(exported).items() if key in held
    }
    steps = [np.diff(each.topics["IMU[1]"]["timestamp"]) for each in (log, exported)]
    np.testing.assert_allclose(*steps, atol=1e-9)
    if form == "structures":
        assert exported.system == log.system == "ArduCopter 4.5.7"
        assert exported.parameters == {"FRAME_CLASS": 1.0, "FRAME_TYPE": 3.0}


@pytest.mark.parametrize("form", ["structures", "matrices"])
def test_an_integral_is_no_number_of_an_instance(read, form):
    own = {"TimeUS": 1e6 + 1e4 * np.arange(40.0), "I": 3 * np.sin(0.3 * np.arange(40.0))}
    named = {"ATT": own | {"Roll": np.arange(40.0)}, "PIDR": own}
    matrices = {name: np.column_stack([*fields.values()]) for name, fields in named.items()}
    labels = {f"{name}_label": np.array([*fields], dtype=object) for name, fields in named.items()}
    topics = read(named if form == "structures" else matrices | labels, "log.mat").topics
    assert topics.keys() == named.keys()
    assert topics["PIDR"]["I"] == pytest.approx(own["I"])


@pytest.mark.parametrize("stamps", ["abc", np.empty(0), np.array([1.0, np.nan, 3.0]), np.ones((3, 3))])
def test_what_has_no_stamps_is_no_message(read, stamps):
    assert "ATT/Roll" in read({"ATT": {"TimeUS": stamps, "Roll": np.ones(3)}}, "log.mat").topics[""]
