"""What people see on a terminal, and what -v and --json print."""

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli import compiling
from cpfls_cli.cli.options import Common
from cpfls_cli.cli.terminal import progress_bar, tell
from cpfls_cli.errors import visible
from cpfls_cli.page import said
from cpfls_cli.report.content import Folded, Outcome, Text
from cpfls_cli.report.terminal import terminal_lines
from tests.builders.forked import Forked
from tests.builders.studies import VEHICLE, put_file

COMMANDS = ("trajectory", "simulate", "import", "reduce", "identify", "report")


@pytest.fixture
def on_terminal(tmp_path_factory):
    """Run a command with standard error on a terminal; give exit code, output and what was shown."""

    def call(*words, columns=200):
        ours, theirs = pty.openpty()
        printed = tmp_path_factory.mktemp("printed") / "stdout"
        process = Forked(words, printed, theirs, environment={"TERM": "xterm", "COLUMNS": str(columns)})
        os.close(theirs)
        shown = b""
        while part := _read(ours):
            shown += part
        os.close(ours)
        done = process.wait()
        return done.returncode, done.stdout, re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode())

    return call


def _read(descriptor):
    try:
        return os.read(descriptor, 65536)
    except OSError:  # Linux reports the end of a terminal as an error.
        return b""


@pytest.fixture
def identify(pipeline, study, tmp_path):
    keys = ("population=30", "generations=3", "validation.enabled=false")
    search = [word for key in keys for word in ("--set", f"identification.{key}")]
    return ("identify", study, pipeline.flight, "-o", tmp_path / "model.h5", "--json", *search)


def test_bar_shows_the_generation_and_the_time_left(on_terminal, identify):
    code, printed, shown = on_terminal(*identify)
    assert code == 0, shown
    assert printed.startswith("{")
    assert re.search(r"identify .*\d+% \d:\d\d:\d\d generation \d of 3", shown)
    assert "reads" not in shown


def test_verbose_speaks_on_a_terminal_too(on_terminal, identify, tmp_path):
    code, _, shown = on_terminal(*identify, "-v")
    assert code == 0, shown
    assert "identify: reads " in shown
    assert re.search(rf"identify: wrote {re.escape(str(tmp_path))}/model.h5 \([\d.]+ kB\) in [\d.]+ s", shown)
    assert "generation" in shown


def test_quiet_shows_nothing(on_terminal, identify):
    assert on_terminal(*identify[:5], "-q") == (0, "", "")


def test_bar_and_time_stay_whole_on_a_terminal_of_80_columns(on_terminal, identify):
    code, _, shown = on_terminal(*identify, columns=80)
    assert code == 0, shown
    lines = [line.rstrip() for line in re.split(r"[\r\n]+", shown) if line.startswith("identify ")]
    assert lines
    assert max(map(len, lines)) <= 80
    timed = re.compile(r"identify [━╸╺ ]{20} +\d+% \d:\d\d:\d\d generation \d of 3 .*")
    last = [line for line in lines if timed.fullmatch(line)]
    assert last, lines
    # The note is longer than what is left of the line.
    assert any(line.endswith("…") for line in last)


def test_time_left_of_a_resumed_search_is_that_of_its_own_pace(monkeypatch):
    from rich import progress

    clock, bars = [0.0], []

    class Timed(progress.Progress):
        def __init__(self, *columns, **options):
            super().__init__(*columns, get_time=lambda: clock[0], **options)
            bars.append(self)

    monkeypatch.setattr(progress, "Progress", Timed)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with progress_bar("identify", Common()) as show:
        # Eight generations of 26 were bred before, and say nothing of how long one takes.
        for done in (8.0, 8.5, 9.0, 9.5):
            show(done, 26)
            clock[0] += 3.0
        (task,) = bars[0].tasks
        assert task.time_remaining == pytest.approx((26 - 9.5) * 6.0, abs=1.0)


@pytest.fixture
def answer(capsys):
    """Tell an outcome; give the lines of both streams."""

    def call(outcome, **options):
        tell(outcome, Common(**options))
        return [stream.splitlines() for stream in capsys.readouterr()]

    return call


def test_an_answer_ends_with_the_next_command_and_what_more_there_is(answer):
    blocks = (Text("the answer"), Folded("why", [Text("because")]), Folded("how", [Text("so")]))
    outcome = Outcome({}, blocks, next=(("cpfls", "check", Path("a name.h5")),))
    following = ["next:", "  cpfls check 'a name.h5'"]
    assert answer(outcome) == [["the answer", *following, "more with -v: why; how"], []]
    assert answer(outcome, verbose=True) == [["the answer", "why:", "because", "how:", "so", *following], []]
    assert answer(outcome, quiet=True) == [[], []]


def test_an_answer_says_what_shows_more_of_it_without_computing_it_again(answer, pipeline, tmp_path):
    blocks = (Text("the answer"), Folded("why", [Text("because")]))
    *_, more, last = answer(Outcome({}, blocks, written=pipeline.model))[0]
    assert (more, last) == ("more with -v: why", f"or with cpfls info {pipeline.model} -v")
    # What is no file of results does not hold what was answered.
    page = put_file(tmp_path / "page.html", "<!DOCTYPE html>")
    assert answer(Outcome({}, blocks, written=page))[0][-1] == "more with -v: why"
    assert answer(Outcome({}, (Text("all"),), written=pipeline.model))[0] == ["all"]


def test_notes_that_say_the_same_of_several_files_are_one(answer):
    slow = [
        f"a log {name}.bin: logged at {rate} Hz (C1): too slow" for name, rate in (("x", 9.78), ("y", 10), ("z", 9.8))
    ]
    other = "a log y.bin: full of noise"
    blocks = tuple(Text(note, "warning", always=True) for note in (slow[0], other, *slow[1:]))
    merged = "a log x.bin and 2 more: logged at 9.78 to 10 Hz (C1): too slow"
    assert answer(Outcome({}, blocks))[1] == [f"cpfls: note: {each}" for each in (merged, other)]
    # Asked for, each stands by itself.
    assert answer(Outcome({}, blocks), verbose=True)[1] == [f"cpfls: note: {block.text}" for block in blocks]
    without = tuple(Text(note, "warning") for note in ("no colon", "name: no colon", "other: no colon"))
    assert answer(Outcome({}, without))[1] == ["cpfls: note: no colon", "cpfls: note: name and 1 more: no colon"]
    # What is done to a file is no name: "the first 3.1 s are cut and 1 more: ..." said nothing.
    cut = tuple(Text(f"the {end} s are cut: it is on the ground", "warning") for end in ("first 3.1", "last 7.0"))
    assert answer(Outcome({}, cut))[1] == ["cpfls: note: the first 3.1 s are cut: it is on the ground (1 more like it)"]


def test_what_the_answer_says_is_no_note_too(answer):
    note = Text("vehicle.h5: DO NOT USE: predicts no better.", "warning", always=True)
    said = (Text("The gap is that of vehicle.h5: DO NOT USE: predicts no better."), note)
    assert answer(Outcome({}, said)) == [[said[0].text], []]
    shown = [f"cpfls: note: {note.text}"]
    assert answer(Outcome({}, (Text("a gap"), note)))[1] == shown
    # For machines the notes are all there is of it.
    assert answer(Outcome({}, said), as_json=True)[1] == shown


def test_on_a_terminal_notes_are_broken_between_words_and_come_before_the_answer(monkeypatch):
    order = []
    monkeypatch.setattr("cpfls_cli.cli.terminal._columns", lambda *_: 30)
    monkeypatch.setattr("builtins.print", lambda text, **_: order.append(text))
    tell(Outcome({}, (Text("the answer"), Text("a note of several words here", "warning"))), Common())
    assert order == ["cpfls: note: a note of several\nwords here", "the answer"]


def test_notes_leave_the_answer_on_the_screen(answer):
    notes = [f"note {number} {'x' * 80}" for number in range(5)]
    warned = [Text(note, "warning", always=number == 4) for number, note in enumerate(notes)]
    shown = [f"cpfls: note: {notes[index]}" for index in (0, 1, 4)]
    assert answer(Outcome({}, tuple(warned)))[1] == [*shown, "cpfls: note: 2 more notes: -v shows them"]
    assert answer(Outcome({}, tuple(warned)), verbose=True)[1] == [f"cpfls: note: {note}" for note in notes]
    # One that is longer than that is shown all the same.
    assert answer(Outcome({}, (Text("x" * 1000, "warning"),)))[1] == [f"cpfls: note: {'x' * 1000}"]


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        ({}, ["gap:  40%  92 s left  half of it", "gap:  80%  31 s left  most of it"]),
        (
            {"verbose": True},
            [
                "gap:  20%  8 s left  ",
                "gap:  40%  92 s left  half of it",
                "gap:  80%  31 s left  most of it",
                "gap: 100%  ",
            ],
        ),
        ({"quiet": True}, []),
    ],
)
def test_a_log_hears_of_long_work_once_a_minute(monkeypatch, capsys, options, shown):
    clock = [0.0]
    monkeypatch.setattr("cpfls_cli.cli.terminal.time.monotonic", lambda: clock[0])
    with progress_bar("gap", Common(**options)) as show:
        for second, done, note in (
            (2, 1, ""),
            (61, 2, "half of it"),
            (61.5, 3, ""),
            (125, 4, "most of it"),
            (126, 5, ""),
        ):
            clock[0] = second
            show(done, 5, note)
    assert capsys.readouterr().err.splitlines() == shown


def test_an_encoding_without_the_signs_of_the_tables_ends_no_command(study, tmp_path):
    command = [sys.executable, "-m", "cpfls_cli", "trajectory", study, "-o", tmp_path / "t.h5"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    result = subprocess.run([*map(str, command)], env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert re.search(r"^pop +m/s[?] +[0-9.]+$", result.stdout, re.MULTILINE)


def test_first_use_says_that_it_compiles(capsys):
    compiling._say_compiling.cache_clear()
    # What no file holds cannot be kept.
    function = eval("lambda number: number + 1")
    with progress_bar("identify", Common(verbose=True)):
        assert compiling.compiled(function)(1) == 2
        compiling.compiled(eval("lambda number: number + 2"))(1)
    # Nobody asked.
    compiling._say_compiling.cache_clear()
    compiling.compiled(function)(1.0)
    said = "identify: compiling for this processor, which takes up to half a minute and is kept\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize("name", ["a\nb.h5", "a\rcpfls: error: b.h5", "a\x1b[31mb.h5"])
def test_a_name_with_control_characters_stays_on_its_line(refuse, tmp_path, monkeypatch, name):
    path = tmp_path / name
    monkeypatch.setattr(sys, "argv", ["cpfls", "info", str(path)])
    (line,) = refuse("info", path)
    assert line == f"{tmp_path}/{repr(name)[1:-1]}: no such file"
    assert line.isprintable()


@pytest.mark.parametrize("closed", ["stdin", "stdout", "stderr"])
def test_a_stream_that_the_caller_closed(study, tmp_path, closed):
    output = tmp_path / "trajectory.h5"
    streams = {"stdin": 0, "stdout": tmp_path / "out", "stderr": tmp_path / "err"} | {closed: None}
    done = Forked(("trajectory", study, "-o", output), **streams).wait()
    assert (done.returncode, getattr(done, "stderr", "")) == (0, "")
    assert output.read_bytes().startswith(b"\x89HDF")


def test_streams_that_the_caller_closed(study, tmp_path):
    output = tmp_path / "trajectory.h5"
    command = '"$1" -m cpfls_cli trajectory "$2" -o "$3" <&- >&- 2>&-'
    done = subprocess.run(["sh", "-c", command, "sh", sys.executable, study, output], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert output.read_bytes().startswith(b"\x89HDF")


@pytest.mark.parametrize("order", ["\u202e", "\u2066", "\u200b", "\x1b[2J", "\u00ad"])
def test_what_turns_or_hides_text_in_a_name_reaches_no_terminal_and_no_page(order):
    block = Text(f"gyro_x{order} is no column")
    escaped = repr(order)[1:-1]
    assert "".join(terminal_lines([block])) == f"gyro_x{escaped} is no column"
    assert order not in said(block.text)
    assert visible("a table\n\tß → µ ́") == "a table\n\tß → µ ́"


LOG = "t,p,q,r,roll,pitch,yaw\n" + "".join(
    f"{row / 100},0.1,0.2,0.3,{row % 7},{row % 5},{row % 3}\n" for row in range(400)
)
SIGNALS = "{body_rate: {columns: [p, q, r], unit: rad/s}, body_torque: {columns: [roll, pitch, yaw], unit: N m}}"


@pytest.fixture
def words(pipeline, tmp_path):
    """Arguments of each stage command, inputs first."""
    log = put_file(tmp_path / "log.csv", LOG)
    return {
        "trajectory": ([], []),
        "simulate": ([pipeline.trajectory], []),
        "import": ([log], ["--set", "import.time_column=t", "--set", f"import.signals={SIGNALS}"]),
        "reduce": ([pipeline.flight], []),
        "identify": ([pipeline.flight], []),
        "report": ([pipeline.trajectory, pipeline.selection], []),
    }


@pytest.mark.parametrize("command", COMMANDS)
def test_verbose_names_what_is_read_and_written(cpfls, words, study, tmp_path, command):
    inputs, options = words[command]
    output = tmp_path / "out"
    result = cpfls.done(command, study, *inputs, "-o", output, "-v", *options)
    said = [line for line in result.stderr.splitlines() if re.match(rf"{command}: (reads|wrote) ", line)]
    sizes = r" \([\d.]+ (bytes|kB|MB)\)"
    patterns = [rf"{command}: reads {re.escape(str(path))}{sizes}" for path in [study, *inputs]]
    patterns.append(rf"{command}: wrote {re.escape(str(output))}{sizes} in \d+\.\d\d s")
    assert len(said) == len(patterns)
    assert all(re.fullmatch(pattern, line) for pattern, line in zip(patterns, said, strict=True)), said


def test_size_is_that_of_the_file(cpfls, study, tmp_path):
    result = cpfls("trajectory", study, "-o", tmp_path / "t.h5", "-v")
    assert f"({(tmp_path / 't.h5').stat().st_size / 1000:.1f} kB)" in result.stderr


@pytest.mark.parametrize("options", [(), ("-q",), ("-q", "-v")], ids=" ".join)
def test_nothing_is_said_unasked(cpfls, study, tmp_path, options):
    assert cpfls("trajectory", study, "-o", tmp_path / "t.h5", *options).stderr == ""


def test_a_dry_run_writes_nothing_and_says_so(cpfls, study, tmp_path):
    result = cpfls("trajectory", study, "-o", tmp_path / "t.h5", "-v", "--dry-run")
    assert "reads" in result.stderr
    assert "wrote" not in result.stderr


KEYS = {
    "trajectory": {"samples", "duration_s", "dt_s", "max"},
    "flight": {"samples", "max_torque"},
    "selection": {"candidates", "selected", "criterion", "rank", "condition_number", "condition_number_full"},
    "model": {
        "mse",
        "max_error",
        "relative_error",
        "condition_number",
        "rank",
        "parameters",
        "generations",
        "evaluations",
        "baselines",
        "held_out",
        "seconds",
    },
}


@pytest.mark.parametrize("stage", KEYS)
def test_json_is_one_object_on_one_line_with_the_promised_keys(pipeline, stage):
    assert pipeline.printed[stage].count("\n") == 1
    assert KEYS[stage] <= set(pipeline.summaries[stage])


def test_figures_of_the_tiny_study(pipeline):
    trajectory, flight, selection, model = (pipeline.summaries[stage] for stage in KEYS)
    # Rows of 54.86 s at 0.1 s, counted from 0; and the selection that the config asks for.
    assert trajectory["samples"] == flight["samples"] == 549
    assert trajectory["dt_s"] == 0.1
    assert len(flight["max_torque"]) == 3
    assert (selection["candidates"], selection["selected"], selection["rank"]) == (549, 60, 113)
    assert (model["parameters"], model["rank"], model["generations"]) == (113, 113, 1)
    assert model["evaluations"] >= 10
    assert {"rigid-body", "constant-inertia", "torque-zero"} <= set(model["baselines"])
    assert model["baselines"]["rigid-body"]["mse"] < 1e-20 < model["mse"]
    assert model["held_out"] == {}


def test_held_out_part_and_other_flights_are_judged_by_name(cpfls, pipeline, study, tmp_path):
    path, other = tmp_path / "path.h5", tmp_path / "other.h5"
    cpfls("trajectory", study, "-o", path, "--set", "trajectory.sample_time_s=0.2")
    cpfls("simulate", study, path, "-o", other)
    words = ("identify", study, pipeline.flight, "--validate", other, "-o", tmp_path / "m.h5", "--json")
    held_out = json.loads(cpfls(*words, "--set", "identification.training_share=0.6").stdout)["held_out"]
    assert set(held_out) == {"held-out rest", "other.h5"}
    assert held_out["other.h5"]["samples"] == 275
    assert {"mse", "relative_error", "baselines"} <= set(held_out["held-out rest"])


def test_an_import_shows_in_json_and_in_lines_what_it_read_and_what_it_did_about_it(cpfls, tmp_path):
    time = np.delete(np.arange(0.0, 4.0, 0.02), [50, 51, 52])
    angles = [0.2 * np.sin((2 + axis) * time) for axis in range(3)]
    angles[1][120] += 1
    log, config = tmp_path / "log.csv", tmp_path / "study.yaml"
    np.savetxt(log, np.column_stack([time, *angles]), delimiter=",", header="t,roll,pitch,yaw", comments="")
    signals = "signals: {attitude: {columns: [roll, pitch, yaw], unit: rad}}"
    config.write_text(f"import: {{{signals}, torque_source: null, crop_s: [0, 3.5]}}\n{VEHICLE}")
    result = cpfls("import", config, log, "-o", tmp_path / "flight.h5", "--json")
    assert (result.exit_code, result.stdout.count("\n")) == (0, 1)
    summary = json.loads(result.stdout)
    assert summary["samples"] == 176
    assert summary["rate_hz"] == summary["log_rate_hz"] == pytest.approx(50)
    assert summary["dropped"] == {"crop": 24}
    assert (summary["gaps"], summary["longest_gap_s"]) == (1, pytest.approx(0.08))
    assert summary["span_s"] == pytest.approx([0, 3.5])
    assert (summary["lowpass_hz"], summary["spikes"], summary["suspected_spikes"]) == (None, {}, {"pitch": 1})
    assert {"samples_read", "missing", "saturated", "delay_s", "delay_r2", "signals"} <= set(summary)
    assert "1 suspected spike in column pitch" in result.stderr
    repaired = cpfls("import", config, log, "-o", tmp_path / "f.h5", "--set", "import.spike_deviations=10", "-v")
    assert [line.rsplit(maxsplit=1) for line in repaired.stdout.splitlines()[-3:]] == [
        ["outside import.crop_s: rows dropped", "24"],
        ["gaps in the time stamps, up to 0.08 s: interpolated", "1"],
        ["spikes: values interpolated", "1"],
    ]
    assert "What was found in the log of f.h5." in repaired.stdout.splitlines()
    assert "spike" not in repaired.stderr
