"""Fixtures of all packages of tests."""

import copy
import gc
import os
import signal
import sys
from functools import lru_cache

import pytest
from hypothesis import settings

from cpfls_cli import store
from cpfls_cli.changes import judge, trend
from cpfls_cli.files import state_of
from tests.builders import command_line, compiled_loops

# A shell without job control has what it starts in the background ignore interrupts, and all that this starts in turn.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Two workers and hundreds of processes import the same modules: they are compiled once, whatever the environment says.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# What is written is read on the same machine: waiting for its disk takes ten ms a file, and no test asks for it.
os.fsync = lambda _: None

# As the program itself does, and later still: a tenth of the time of the tests went into looking for garbage among what
# stays.
gc.set_threshold(100_000, *gc.get_threshold()[1:])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes():
    """Compile the loops once, and not in each worker that first calls them."""
    compiled_loops.compile_missing()


def pytest_collection_finish():
    """Leave what is there for good, modules and thousands of tests, out of every later look for garbage."""
    gc.collect()
    gc.freeze()


# How long an example takes is the machine's, and no test asks for it.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


def read_once():
    """Give what reads a file anew only where it is another than before, which takes a tenth of the time of tests."""
    examine = store.examine
    known = lru_cache(32)(lambda path, _, kind, rows: examine(path, kind, rows))

    def examined(path, kind, rows=None):
        return copy.deepcopy(known(path, state_of(path) if path.is_file() else None, kind, rows))

    return examined


@pytest.fixture(scope="session", autouse=True)
def spare():
    """Leave pictures away, but where a test looks at them; draw chance for a rate of 0.005; read a file once."""
    with command_line.undrawn(), pytest.MonkeyPatch.context() as monkeypatch:
        for module, most in ((trend, 300), (judge, 600)):
            # Fewer of what is too little for its own tests stay so.
            monkeypatch.setattr(module, "_DRAWS", min(most, module._DRAWS))
        monkeypatch.setattr(store, "examine", read_once())
        yield


@pytest.fixture
def drawn():
    """Draw the pictures of pages."""
    with command_line.drawn():
        yield


@pytest.fixture
def sketched():
    """Make the pictures of pages, which nobody looks at."""
    with command_line.drawn(shown=False):
        yield


@pytest.fixture
def brief(monkeypatch):
    """Fly what is not held for five samples, where a test asks what it is called and how large its torque is."""

    def ends(held, flight):
        return held.errors(flight, flight.starts(5, len(flight)), 5)[:, -1]

    monkeypatch.setattr("cpfls_cli.export.holding._ends", ends)
