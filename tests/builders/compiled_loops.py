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
    from cpfls_cli.regressor.motion import Motion
    from cpfls_cli.regressor.regressor import data_ranges, uniform_breakpoints
    from cpfls_cli.regressor.structure import StructureSettings, model_structure

    zeros, structure = np.zeros((1, 3)), model_structure(StructureSettings())
    data = TorqueData(np.zeros(1), Motion(zeros, zeros, zeros), zeros)
    samples = Samples.of(Ready(data, rigid=False), structure, data_ranges(structure, zeros))
    samples.products(uniform_breakpoints(structure))


def playback():
    """Run a vehicle for one step."""
    from cpfls_cli.playback.kernels import errors_of_runs
    from cpfls_cli.playback.motion import MeasuredMotion
    from cpfls_cli.playback.model import VehicleModel
    from cpfls_cli.vehicle.settings import VehicleSettings

    model, still = VehicleModel(vehicle=VehicleSettings()), np.zeros((2, 3))
    used, weights = model.table.by_step(np.ones((2, 1 + 4 * model.rotors)))
    motion = MeasuredMotion(still, still, np.tile(np.eye(3), (2, 1, 1)), still, 0.01)
    errors_of_runs(motion, model.body, used, weights, np.zeros(1, np.int64), True, np.zeros((1, 1, 4, 3)))


LOOPS = {"regressor": regressor, "playback": playback}


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
