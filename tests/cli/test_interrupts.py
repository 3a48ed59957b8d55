"""Interrupts and closed pipes, with real processes."""

import importlib
import itertools
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from cpfls_cli.cli import terminal
from tests.builders.forked import Forked, finished

MESSAGE = "cpfls: error: interrupted: no half-written file is left\n"
PROGRAM = [sys.executable, "-m", "cpfls_cli"]
# Sends the signal to itself the moment a module is looked for, in place of a guess at the time of loading.
INTERRUPTED_IMPORT = """
import os, signal, sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                if {swallow}:
                    raise ImportError("a compiled module that lost the interrupt") from None
                raise

sys.meta_path.insert(0, Finder())
sys.argv = {words!r}
from cpfls_cli.cli.main import run
run()
"""


def environment():
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1"}


def with_a_line_for_each_generation():
    """Let a second pass each time that somebody looks, after which a line is due."""
    terminal.time = SimpleNamespace(monotonic=itertools.count().__next__, perf_counter=time.perf_counter)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_during_the_search_keeps_what_can_be_resumed(pipeline, study, tmp_path, tmp_path_factory, number, code):
    output = tmp_path / "model.h5"
    words = ["identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", output, "-v"]
    endless = ["--set", "identification.generations=100000"]
    reading, writing = os.pipe()
    printed = tmp_path_factory.mktemp("printed") / "stdout"
    process = Forked([*words, *endless], printed, writing, patch=with_a_line_for_each_generation)
    os.close(writing)
    with open(reading) as said:
        assert any(line.startswith("identify: ") and "generation 2" in line for line in said)
        process.send(number)
        messages = said.read()
    assert process.wait().returncode == code
    assert messages.endswith("the search was interrupted; the same command with --resume goes on\n")
    assert "Traceback" not in messages
    assert "--resume" in (answer := printed.read_text())
    assert "identification.validation.enabled" not in answer
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.h5", "model.h5.checkpoint"]


@pytest.mark.parametrize(
    ("module", "function", "number", "said"),
    [
        (
            "cpfls_cli.identification.identify",
            "fit_baselines",
            signal.SIGINT,
            "is intact; the same command with --resume",
        ),
        ("cpfls_cli.validation.validate", "replay_steps", signal.SIGTERM, "was found but not judged, because of"),
    ],
)
def test_signal_while_a_model_is_judged(pipeline, study, tmp_path, tmp_path_factory, module, function, number, said):
    """The signal comes the moment a function is called that comes after the search."""

    def signalling():
        home = importlib.import_module(module)
        was = getattr(home, function)

        def signalled(*given, **named):
            os.kill(os.getpid(), number)
            return was(*given, **named)

        setattr(home, function, signalled)

    words = ("identify", study, pipeline.flight, "-o", tmp_path / "model.h5")
    result = finished(words, tmp_path_factory.mktemp("printed"), patch=signalling)
    assert (result.returncode, said in result.stderr) == (128 + number, True), result.stderr
    assert "Traceback" not in result.stderr
    # What goes on with --resume is there, and next to it the model, where it was found.
    found = ["model.h5"] if number == signal.SIGTERM else []
    assert sorted(path.name for path in tmp_path.iterdir()) == [*found, "model.h5.checkpoint"]


@pytest.mark.parametrize(
    ("module", "swallow"),
    [("typer", False), ("pydantic", True), ("numpy", True), ("h5py", False), ("scipy.linalg", True)],
)
def test_interrupt_while_loading(pipeline, study, tmp_path, module, swallow):
    words = ["cpfls", "identify", str(study), str(pipeline.flight), "-o", str(tmp_path / "model.h5")]
    code = INTERRUPTED_IMPORT.format(module=module, swallow=swallow, words=words)
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment())
    assert (result.returncode, result.stdout, result.stderr) == (130, "", MESSAGE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["config"], ["--version"]])
def test_reader_that_has_seen_enough(words):
    with subprocess.Popen([*PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        messages = process.stderr.read()
    assert (process.returncode, messages) == (141, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="the system has no device that is always full")
def test_output_to_a_full_disk():
    with open("/dev/full", "w") as full:
        result = subprocess.run([*PROGRAM, "config"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (result.returncode, result.stderr) == (1, "cpfls: error: output: No space left on device\n")


def test_an_interrupt_that_a_destructor_swallows_comes_again():
    code = (
        "import os, signal, time\n"
        "from cpfls_cli.cli.interrupts import interruptible\n"
        "class Swallows:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        time.sleep(0.01)\n"
        "with interruptible():\n"
        "    one = Swallows()\n"
        "    del one\n"
        "    time.sleep(20)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 130
    assert done.stderr == MESSAGE
