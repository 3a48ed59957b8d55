"""A file that keeps HDF5 busy for ever, sealed as if it were good, ends in a message, and by a signal."""

import signal
import subprocess
import sys
import time

import pytest

from tests.builders.artifacts import circular

SOON = """
import sys
from cpfls_cli.artifacts import patience

patience.longest_read_s = lambda size: 1.0
from cpfls_cli.cli.main import run

run()
"""

TOLD = """
import h5py

opened = h5py.File

def told(*words):
    print("reads", flush=True)
    return opened(*words)

h5py.File = told
from cpfls_cli.cli.main import run

run()
"""


@pytest.fixture
def looping(tmp_path):
    return circular(tmp_path / "loop.h5")


def test_what_never_ends_is_ended_with_a_message(looping):
    words = [sys.executable, "-c", SOON, "info", str(looping)]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2 if sys.platform == "linux" else ended.returncode
    assert ended.stdout == ""
    assert ended.stderr == f"cpfls: error: {looping}: damaged: HDF5 did not finish reading it within 1 s\n"


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_ends_it_too(looping):
    words = [sys.executable, "-c", TOLD, "check", str(looping)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "reads\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    assert said == f"cpfls: error: {looping}: interrupted while HDF5 was reading it\n"
