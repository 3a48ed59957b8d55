"""`cpfls look` on logs of each autopilot, from the command line to what a person reads."""

import gzip
import re
from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import page
from cpfls_cli.look.answers import Answer
from cpfls_cli.look.balance import balance_of
from cpfls_cli.look.gains import AxisGains, AxisMargins, TunedGains
from cpfls_cli.look.look import Logged, Look
from cpfls_cli.look.timeline import Event
from cpfls_cli.result import Estimate
from tests.builders import looked_logs
from tests.builders.blackbox_logs import signed
from tests.builders.dataflash_logs import dataflash
from tests.builders.look_flights import CROSS, hovering
from tests.builders.unknown_logs import flat_log, flight, named, ulog_of_flight, write_csv

OWN = flight(seconds=15.0)
MOST_LINES = 15


def ardupilot_bytes():
    """The flight as ArduPilot's card has it."""
    contents = looked_logs.ardupilot(OWN)
    kinds = {
        topic: ("Q" + "f" * (len(own) - 1), ",".join(["TimeUS", *list(own)[1:]]))
        for topic, own in contents.topics.items()
    }
    rows = [
        (topic, (round(1e6 * stamp), *values))
        for topic, own in contents.topics.items()
        for stamp, *values in np.column_stack(list(own.values())).tolist()
    ]
    rows.sort(key=lambda row: row[1][0])
    return dataflash(kinds, rows, contents.parameters, ["ArduCopter V4.5.7 (abc)", "Frame: QUAD/X"])


def blackbox_bytes():
    """The flight as a blackbox has it: every frame whole, every field a signed number."""
    contents = looked_logs.betaflight(OWN)
    fields = dict(contents.topics[""])
    scales = {"time": 1e6, "vbatLatest": 100.0, **{f"accSmooth[{k}]": 2048.0 for k in range(3)}}
    columns = {"loopIteration": np.arange(len(OWN.time)), **fields}
    rows = np.stack([np.round(scales.get(name, 1.0) * values) for name, values in columns.items()], axis=1)
    lines = {
        "Product": "Blackbox flight data recorder by Nicholas Sherlock",
        "Data version": "2",
        "I interval": "1",
        "P interval": "1/1",
        "Field I name": ",".join(columns),
        **{f"Field {kind} {what}": ",".join("0" * len(columns)) for kind in "IP" for what in ("predictor", "encoding")},
        "Field I signed": ",".join("1" * len(columns)),
        "Firmware type": "Cleanflight",
        "Firmware revision": "Betaflight 4.5.1 (77d01ba3b) STM32F7X2",
        "gyro_scale": "0x3f800000",
        "acc_1G": "2048",
        "minthrottle": "1070",
        "vbatref": "1600",
        **contents.parameters,
    }
    head = "".join(f"H {key}:{value}\n" for key, value in lines.items()).encode()
    return head + b"".join(b"I" + b"".join(map(signed, row)) for row in rows.astype(int).tolist())


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A folder with a log of each autopilot, and one that has no gyroscope."""
    folder = tmp_path_factory.mktemp("logs")
    (folder / "px4 log.ulg").write_bytes(ulog_of_flight(OWN))
    (folder / "ap.bin").write_bytes(ardupilot_bytes())
    (folder / "bf.bbl").write_bytes(blackbox_bytes())
    write_csv(folder / "blind.csv", flat_log(OWN, rate=None, attitude=None))
    return folder


@pytest.mark.parametrize(
    ("name", "system", "rotors"),
    [("px4 log.ulg", "PX4", 4), ("ap.bin", "ArduCopter", 4), ("bf.bbl", "Betaflight 4.5.1", 4)],
)
def test_one_log_is_answered_in_fifteen_lines(cpfls, logs, name, system, rotors):
    result = cpfls.done("look", logs / name)
    first, facts, answers, *rest = result.stdout.splitlines()
    assert first.startswith("Flies")
    assert facts.startswith(f"{name}: {system}")
    assert f"{rotors} rotors" in facts
    assert answers.startswith("Answers: ")
    assert [line for line in rest if line in ("Healthy?", "Change", "Fly next")] == ["Healthy?", "Change", "Fly next"]
    assert len(result.stdout.split("next:\n")[0].splitlines()) <= MOST_LINES
    assert "--mass KG --arm M -o study.yaml" in result.stdout


def test_a_log_that_shows_no_flight_of_a_multirotor_is_refused_with_code_1(refuse, logs):
    (said,) = refuse("look", logs / "blind.csv", code=1)
    assert said.startswith(f"{logs / 'blind.csv'}: a log without a gyroscope")
    assert said.count("blind.csv") == 1


def test_what_is_no_log_is_refused_with_code_2(refuse, logs):
    assert refuse("look", logs) == [f"{logs}: is a folder; give its logs: cpfls look {logs}/*"]
    assert refuse("look", logs / "none.bbl") == [f"{logs / 'none.bbl'}: no such file"]


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz"])
def test_a_whole_log_that_is_called_as_a_topic_of_px4_is_read(cpfls, tmp_path, suffix):
    whole = flat_log(OWN)
    whole.topics[""] = {"timestamp": whole.topics[""].pop("t"), **whole.topics[""]}
    text = write_csv(tmp_path / "log.csv", whole).read_bytes()
    log, config = tmp_path / f"log_vehicle_attitude_0{suffix}", tmp_path / "study.yaml"
    log.write_bytes(gzip.compress(text) if suffix.endswith(".gz") else text)
    assert "balance" in cpfls("look", log).stdout
    cpfls("init", log, "--mass", 0.8, "--arm", 0.16, "-o", config)
    cpfls("import", config, log, "-o", tmp_path / "flight.h5")


@pytest.mark.parametrize(("command", "code"), [(("look",), 1), (("init", "-o", "study.yaml"), 2)])
def test_one_topic_of_px4_alone_is_called_so(refuse, tmp_path, monkeypatch, command, code):
    monkeypatch.chdir(tmp_path)
    time = np.arange(0.0, 10.0, 0.05)
    rows = [f"{round(1e6 * at)},{158 + at / 10}" for at in time]
    (tmp_path / "log_vehicle_air_data_0.csv").write_text("\n".join(["timestamp,baro_alt_meter", *rows, ""]))
    (said,) = refuse(command[0], "log_vehicle_air_data_0.csv", *command[1:], code=code)
    assert said.startswith("log_vehicle_air_data_0.csv: by its name vehicle_air_data alone, one topic of a log of PX4")
    assert "if it is a whole log: no column is recognised" in said


@pytest.mark.parametrize(("rate_hz", "log"), [(20.0, "body rates, commands"), (50.0, "")])
def test_commands_that_are_logged_rarely_show_no_inertia_with_mass_and_arm_either(cpfls, tmp_path, rate_hz, log):
    own = flight(rate_hz=rate_hz)
    command = named(own.speed / 1000, "u1", "u2", "u3", "u4")
    summary = cpfls.summary("look", write_csv(tmp_path / "log.csv", flat_log(own, speed=command)), "-o", tmp_path / "o")
    assert summary["answers"][-1]["log"] == log
    assert any("inertia" in own["why"] for own in summary["next_steps"][:-1]) == bool(log)


def test_several_logs_are_a_table_and_a_page_each(cpfls, logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = cpfls.done("look", logs / "px4 log.ulg", logs / "bf.bbl", logs / "blind.csv", "-o", "out")
    assert result.stdout.startswith("3 flights\n")
    index = (tmp_path / "out" / "index.html").read_text()
    assert '<a href="px4%20log.html">px4 log.ulg</a>' in index
    assert re.search("<h1>(.*?)</h1>", (tmp_path / "out" / "bf.html").read_text())[1] in index
    assert "without a gyroscope" in index
    assert result.stdout.count("Nothing to look at") == result.stdout.count("blind.csv") == 1
    assert "- blind.csv: " in result.stdout
    assert sorted(path.name for path in (tmp_path / "out").glob("*.html")) == [
        "bf.html",
        "blind.html",
        "index.html",
        "px4 log.html",
    ]


def test_where_all_are_refused_nothing_is_written(refuse, logs, tmp_path):
    assert len(refuse("look", logs / "blind.csv", logs / "blind.csv", "-o", tmp_path / "out", code=1)) == 1


def test_page_and_json_have_the_answer(cpfls, logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    summary = cpfls.summary("look", logs / "px4 log.ulg", "-o", "out")
    assert [own["question"] for own in summary["answers"]][-1] == "inertia, drag, what a model misses"
    assert summary["next_steps"][-1]["command"].startswith("cpfls init 'px4 log.ulg' ")
    shown = (tmp_path / "out" / "px4 log.html").read_text()
    for title in ("Healthy?", "Change", "Fly next", "What this log can answer", "Answers"):
        assert f">{title}</h" in shown
    again = cpfls("info", tmp_path / "out" / "px4 log.h5", "-v").stdout
    assert f"<h1>{again.splitlines()[0]}</h1>" in shown
    assert len(again.splitlines()) > 2 * MOST_LINES


def words_of(**given):
    return page.words("look", Look(name="log.bin", logged=LOGGED, answers=NO_GAINS, **given))


NO_GAINS = (Answer(question="gains", answer="no", why="nothing is known"),)
LOGGED = Logged(
    name="log.bin",
    system="ArduCopter 4.5.7",
    vehicle="multirotor",
    rotors=4,
    duration_s=60.0,
    flown_s=50.0,
    spans_s=np.array([[5.0, 55.0]]),
    gyroscope="behind",
    signals=(),
)


def test_patterns_are_named_and_no_rotor_is_called_weak():
    yaw = balance_of(hovering(1 + 0.1 * np.array([1.0, 1.0, -1.0, -1.0]), seconds=60))
    assert words_of(balance=yaw).startswith("# Flies, but holds a steady yaw torque: M")
    ahead = balance_of(hovering(1 + 0.1 * np.sign(CROSS[:, 0]), seconds=60, heading=lambda t: np.pi * (t > 30)))
    said = words_of(balance=ahead)
    assert "as if its centre of mass were" in said
    assert "off the middle, ahead" in said
    weak = words_of(balance=balance_of(hovering(np.ones(4), seconds=60, weak={2: 0.8})))
    assert "M3 \\+" in weak.splitlines()[0]
    assert "It may be rotor 3 (propeller, motor or speed controller), or a centre of mass" in weak
    assert "together with a steady yaw torque" in weak
    assert re.search(r"off the middle, (ahead|behind) and (left|right)\b", weak)
    assert "weak" not in weak


def test_margins_are_judged_by_their_intervals():
    def looked(low, value, high):
        def of(low, value, high):
            return Estimate(value=value, low=low, high=high)

        margins = AxisMargins(
            gain_db=of(8.0, 9.0, 10.0),
            phase_deg=of(low, value, high),
            disk_deg=of(low, value, high),
            crossover_hz=of(4.0, 5.0, 6.0),
            bandwidth_hz=of(8.0, 9.0, 10.0),
            holds=0.5,
            stable=1.0,
        )
        gains = TunedGains(
            autopilot="px4",
            title="PX4",
            version="1.15",
            reason="",
            asked_gain=6.0,
            asked_phase=45.0,
            asked_disk=35.0,
            required=45.0,
            axes=(AxisGains(axis="roll", changed=False, reason="", fact="", attitude=False, before=margins),),
        )
        return words_of(gains=gains).splitlines()[0]

    assert looked(10.0, 15.0, 20.0) == "# Flies, but margins of roll are small {warning}"
    assert looked(20.0, 28.0, 40.0) == "# Flies; margins of roll may be small {unsure}"
    assert looked(35.0, 40.0, 45.0) == "# Flies; good, as far as this log shows: margins of roll {good}"
    assert looked(25.0, 40.0, 45.0).startswith("# Flies; this log does not show whether rotors")


def test_a_headline_says_when_before_what():
    text = "the accelerometer reads 0.79 g at rest: calibrate it"
    found = (Event(time_s=0.0, kind="calibration", text=text, severity="warning"),)
    assert words_of(events=found).startswith(f"# Flies; at 0.0 s: {text}")


def test_balanced_rotors_are_within_what_hover_asks_of_each():
    curve = {
        "parameters": {"MOT_THST_EXPO": 0.0001, "MOT_SPIN_MIN": 0.0, "MOT_SPIN_MAX": 1.0},
        "autopilot": "ardupilot",
    }
    places = CROSS - [0.1, 0.0]
    alike = replace(hovering(np.ones(4), gusts=0.005, **curve), places=places)
    expected = np.array([rotor.expected for rotor in balance_of(alike).rotors])
    asked = replace(hovering(expected, gusts=0.005, **curve), places=places)
    for flown, of in ((alike, "their mean"), (asked, "what hover asks of each")):
        assert re.search(rf"balanced: within [12] % of {of}$", words_of(balance=balance_of(flown)), re.MULTILINE)


def test_what_the_vehicle_did_comes_before_what_the_log_lacks():
    gap = Event(time_s=2.7, until_s=2.8, kind="gap", text="no samples for 0.11 s", severity="warning")
    limit = Event(time_s=21.0, until_s=36.0, kind="limit", text="M3 at its upper limit 6 times", severity="warning")
    said = words_of(events=(gap, limit))
    assert said.startswith("# Flies; from 21.0 s on: M3 at its upper limit 6 times; and 1 more warning")
    hard = Event(time_s=37.0, kind="landing", text="lands hard, with 9 g", severity="warning")
    assert words_of(events=(gap, limit, hard)).startswith("# Flies; at 37.0 s: lands hard, with 9 g; and 2 more")
