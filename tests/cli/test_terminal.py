"""What people see on a terminal: a bar with the generation and the time left, and what -v says above it."""

import os
import pty
import re
import subprocess
import sys

import pytest


def on_terminal(*words):
    """Run a command with standard error on a terminal of 200 columns; give exit code, output and what was shown."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "200"}
    command = [sys.executable, "-m", "cpfls_cli", *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, env=environment) as process:
        os.close(theirs)
        shown = b""
        while part := _read(ours):
            shown += part
        os.close(ours)
        printed = process.stdout.read().decode()
    return process.returncode, printed, re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode())


def _read(descriptor):
    try:
        return os.read(descriptor, 65536)
    except OSError:  # Linux reports the end of a terminal as an error.
        return b""


@pytest.fixture
def identify(pipeline, study, tmp_path):
    search = ("--set", "identification.population=30", "--set", "identification.generations=3")
    return ("identify", study, pipeline.flight, "-o", tmp_path / "model.h5", "--json", *search)


def test_bar_shows_the_generation_and_the_time_left(identify):
    code, printed, shown = on_terminal(*identify)
    assert code == 0, shown
    assert printed.startswith("{")
    assert re.search(r"identify .*\d+% \d:\d\d:\d\d generation \d of 3", shown)
    assert "reads" not in shown


def test_verbose_speaks_on_a_terminal_too(identify, tmp_path):
    code, _, shown = on_terminal(*identify, "-v")
    assert code == 0, shown
    assert "identify: reads " in shown
    assert re.search(rf"identify: wrote {re.escape(str(tmp_path))}/model.h5 \([\d.]+ kB\) in [\d.]+ s", shown)
    assert "generation" in shown


def test_quiet_shows_nothing(identify):
    assert on_terminal(*identify[:5], "-q") == (0, "", "")
