"""Equal inputs give equal bytes, on one thread and in any place."""

import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.builders.hostile_files import COLUMNS
from tests.builders.studies import LOG_STUDY, TINY, VEHICLE

STAGES = ("trajectory", "flight", "selection", "model")


@pytest.fixture(scope="module")
def again(cpfls, pipeline, study, tmp_path_factory):
    """The same commands a second later, from another folder and into files of other names."""
    time.sleep(1.1)
    folder = tmp_path_factory.mktemp("again")
    out = {stage: folder / f"again-{stage}.h5" for stage in STAGES}
    for words in (
        ("trajectory", study, "-o", out["trajectory"]),
        ("simulate", study, pipeline.trajectory, "-o", out["flight"]),
        ("reduce", study, pipeline.flight, "-o", out["selection"]),
        ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", out["model"]),
    ):
        cpfls.done(*words)
    return out


@pytest.mark.parametrize("stage", STAGES)
def test_same_seed_same_bytes(pipeline, again, stage):
    assert again[stage].read_bytes() == pipeline.paths[stage].read_bytes()


def test_noise_too_comes_from_the_seed(cpfls, pipeline, study, tmp_path):
    files = [tmp_path / f"{number}.h5" for number in range(3)]
    for path, seed in zip(files, (5, 5, 6), strict=True):
        noise = ("--set", "simulation.relative_noise={torque: 0.05}", "--seed", seed)
        cpfls.done("simulate", study, pipeline.trajectory, "-o", path, *noise)
    first, same, other = (path.read_bytes() for path in files)
    assert first == same
    assert first != other


def test_another_seed_gives_another_model(cpfls, pipeline, study, tmp_path):
    words = ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", tmp_path / "m.h5")
    cpfls.done(*words, "--seed", 7)
    with h5py.File(tmp_path / "m.h5") as other, h5py.File(pipeline.model) as first:
        assert not np.array_equal(other["pareto_front/objectives"], first["pareto_front/objectives"])


def texts(file):
    """All text inside an artifact: attributes, and datasets of text."""
    found = [str(value) for value in file.attrs.values()]

    def visit(_, item):
        found.extend(str(value) for value in item.attrs.values())
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "S":
            found.append(str(item[()]))

    file.visititems(visit)
    return "\n".join(found)


@pytest.mark.parametrize("stage", STAGES)
def test_no_path_no_host_no_date(pipeline, stage):
    content = pipeline.paths[stage].read_bytes()
    for folder in (pipeline.flight.parent, Path.cwd(), Path(tempfile.gettempdir())):
        assert f"{folder}/".encode() not in content
    with h5py.File(pipeline.paths[stage]) as file:
        text = texts(file)
    assert "membership_functions: 5" in text
    assert not re.search(rf"\b{re.escape(socket.gethostname())}\b", text)
    assert not re.search(r"20\d\d-\d\d|\d\d:\d\d", text)


# Reports, when the command has ended, what it limited and how many threads its libraries had started.
PROGRAM = """
import json, os, sys
sys.argv = {words!r}
from cpfls_cli.cli import main
# The timer that ends what hangs has a thread of its own.
main.end_what_hangs = lambda: None
assert "numpy" not in sys.modules, "numpy has read its limits before they were set"
try:
    main.run()
except SystemExit as end:
    code = end.code
tasks = len(os.listdir("/proc/self/task")) if os.path.isdir("/proc/self/task") else 1
limits = {{name: os.environ[name] for name in os.environ if name.endswith("_THREADS")}}
print(json.dumps([code or 0, "numpy" in sys.modules, tasks, limits]))
"""
LIMITS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def test_one_thread_whatever_the_environment_says(pipeline, study, tmp_path):
    words = ("cpfls", "reduce", study, pipeline.flight, "-o", tmp_path / "out.h5", "-q")
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(words=[*map(str, words)])],
        capture_output=True,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"},
    )
    assert result.stderr == ""
    code, numerical, tasks, limits = json.loads(result.stdout)
    assert (code, numerical, tasks) == (0, True, 1)
    assert limits == dict.fromkeys(LIMITS, "1")


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
    said = elsewhere(
        folder,
        ("trajectory", "tiny.yaml", "-o", "path.h5"),
        ("simulate", "tiny.yaml", "path.h5", "-o", "flight ü.h5"),
        ("reduce", "tiny.yaml", "flight ü.h5", "-o", "selection.h5"),
        ("identify", "tiny.yaml", "flight ü.h5", *words),
        ("export", "model.h5", "-o", "model.json", "--force"),
        ("check", "model.h5"),
        ("info", "flight ü.h5"),
    )
    assert "simulated along path.h5" in said.rpartition("model.h5")[2]


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
