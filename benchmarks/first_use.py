"""What the first use of each compiled loop takes in a new process: from nothing, and compiled before.

Processor time of the first call alone; numba itself is loaded before. Compared are processes with an empty cache.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

from benchmarks.shared.measure import program, seconds, table
from tests.builders.compiled_loops import LOOPS


def main(one: str = "") -> None:
    if one:
        print(first_call(one))
        return
    rows = []
    for name in (source for source in LOOPS if source.startswith("cpfls_cli")):
        with tempfile.TemporaryDirectory() as cache:
            command = (sys.executable, "-m", "benchmarks.first_use", "--one", name)
            environment = dict(os.environ, NUMBA_CACHE_DIR=cache)
            rows.append((name, *(float(subprocess.check_output(command, env=environment)) for _ in range(2))))
    table("first_use", "loop | compiling, s | compiled before, s", rows)


def first_call(name: str) -> float:
    """Time the first call of a loop after all else was loaded."""
    import numba  # noqa: F401
    import scipy.signal  # noqa: F401

    import cpfls_cli.effects.catalogue.payload
    import cpfls_cli.identification.samples
    import cpfls_cli.playback.model  # noqa: F401

    return seconds(LOOPS[name])


if __name__ == "__main__":
    program(main)
