"""Loops compiled once, before two processes of tests compile each: `python -m tests.builders.compiled_loops`.

What is compiled lies beside the package, where numba looks for it; it is made again where the source is newer.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

PACKAGE = Path(__file__).resolve().parents[2] / "cpfls_cli"


def regressor():
    """Add up one sample of a model."""
    from cpfls_cli.identification.data import TorqueData
    from cpfls_cli.identification.samples import Ready, Samples
    from cpfls_cli.regressor.regressor import Motion, data_ranges, uniform_breakpoints
    from cpfls_cli.regressor.structure import StructureSettings, model_structure

    zeros, structure = np.zeros((1, 3)), model_structure(StructureSettings())
    data = TorqueData(np.zeros(1), Motion(zeros, zeros, zeros), zeros)
    samples = Samples.of(Ready(data, rigid=False), structure, data_ranges(structure, zeros))
    samples.products(uniform_breakpoints(structure))


LOOPS = {"regressor": regressor}


def missing():
    """Rooms whose loops were not compiled since their source was written."""
    for room in LOOPS:
        kernels = PACKAGE / room / "kernels.py"
        kept = [index.stat().st_mtime for index in (kernels.parent / "__pycache__").glob("kernels.*.nbi")]
        if max(kept, default=0.0) < kernels.stat().st_mtime:
            yield room


def compile_missing():
    """Compile what is missing, side by side."""
    command = (sys.executable, "-m", "tests.builders.compiled_loops")
    started = [subprocess.Popen((*command, room), cwd=PACKAGE.parent) for room in missing()]
    for process in started:
        process.wait()


if __name__ == "__main__":
    for name in sys.argv[1:] or LOOPS:
        LOOPS[name]()
