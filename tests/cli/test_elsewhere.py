"""Other systems as far as can be told here: names that they lack, their texts, and their folders."""

import json
import subprocess
import sys

import pytest

from tests.builders.hostile_files import COLUMNS, LOG_STUDY
from tests.builders.studies import TINY, VEHICLE

# What Windows lacks, but for what Python itself stands on here.
ABSENT = """
import json, os, signal, sys

for name in ("fcntl", "resource", "termios", "pwd", "grp", "tty", "pty"):
    sys.modules[name] = None
for name in ("fork", "forkpty", "killpg", "getuid", "geteuid", "setsid", "chown", "mkfifo", "sync"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGPIPE", "SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGQUIT", "SIGCHLD", "pthread_sigmask", "alarm"):
    if hasattr(signal, name):
        delattr(signal, name)
from cpfls_cli.cli.main import run

for words in json.loads(sys.argv[1]):
    sys.argv = ["cpfls", *words]
    try:
        run()
    except SystemExit as end:
        if end.code:
            raise
"""


def elsewhere(folder, *commands):
    """Run commands one after the other in a process of their own."""
    called = [sys.executable, "-c", ABSENT, json.dumps(commands)]
    ended = subprocess.run(called, cwd=folder, capture_output=True, timeout=300, check=False)
    assert ended.returncode == 0, ended.stderr.decode()
    return ended.stdout.decode("utf-8")


@pytest.fixture
def folder(tmp_path):
    """A folder as people call theirs."""
    own = tmp_path / "Flüge von Zoë (1)"
    own.mkdir()
    return own


def log(ends):
    rows = [
        [0.02 * n, *(0.2 * ((n * (2 + axis)) % 17 - 8) / 8 for axis in range(3)), 0.1, 0.01 * (n % 5), -0.1]
        for n in range(120)
    ]
    return ends.join([",".join(COLUMNS), *(",".join(f"{value:.6g}" for value in row) for row in rows)]) + ends


def test_commands_run_where_names_of_this_system_are_absent(folder):
    (folder / "tiny.yaml").write_text(TINY + VEHICLE, encoding="utf-8")
    words = ("--selection", "selection.h5", "-o", "model.h5", "--workers", "2")
    elsewhere(
        folder,
        ("trajectory", "tiny.yaml", "-o", "path.h5"),
        ("simulate", "tiny.yaml", "path.h5", "-o", "flight ü.h5"),
        ("reduce", "tiny.yaml", "flight ü.h5", "-o", "selection.h5"),
        ("identify", "tiny.yaml", "flight ü.h5", *words),
        ("export", "model.h5", "-o", "model.json", "--force"),
        ("check", "model.h5"),
    )
    assert "flight" in elsewhere(folder, ("info", "flight ü.h5"))


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_texts_with_a_byte_order_mark_and_ends_of_lines_of_windows_are_read(cpfls, folder, ends):
    made = []
    for number, mark in enumerate(("", "\ufeff")):
        study, path, flight = (folder / f"{number} {name}" for name in ("study.yaml", "log.csv", "flight.h5"))
        study.write_bytes((mark + (LOG_STUDY + VEHICLE).replace("\n", ends)).encode())
        path.write_bytes((mark + log(ends)).encode())
        cpfls.done("import", study, path, "-o", flight)
        made.append(cpfls("info", flight, "--json").stdout.count("attitude"))
    assert made[0] == made[1] > 0
