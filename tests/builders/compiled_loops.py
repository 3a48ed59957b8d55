"""Loops compiled once, before two processes of tests compile each: `python -m tests.builders.compiled_loops`.

What is compiled lies next to the package, where numba looks for it; it is made again where the source is newer.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


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


def payload():
    """Swing a load under a hook that stays where it is."""
    from cpfls_cli.effects.catalogue.payload import swing
    from cpfls_cli.effects.signals import Signals
    from cpfls_cli.vehicle.settings import VehicleSettings

    still = {name: np.zeros((99, 3)) for name in ("body_rate", "attitude", "velocity")}
    swing(Signals(time=0.01 * np.arange(99), vehicle=VehicleSettings(), **still), 1.0, 0.1)


def gusts():
    """Fly in gusts for a moment."""
    from tests.builders.gusty_flights import SMALL, Flight, gusty_flights

    list(gusty_flights([Flight(SMALL)], 0.1))


LOOPS = {
    "cpfls_cli/regressor/kernels.py": regressor,
    "cpfls_cli/effects/catalogue/payload.py": payload,
    "tests/builders/gusty_flights.py": gusts,
}
"""What calls the loops of a source."""


def missing():
    """Sources whose loops were not compiled since they were written."""
    for source in LOOPS:
        path = ROOT / source
        kept = [index.stat().st_mtime for index in (path.parent / "__pycache__").glob(f"{path.stem}.*.nbi")]
        if max(kept, default=0.0) < path.stat().st_mtime:
            yield source


def compile_missing():
    """Compile what is missing, side by side."""
    command = (sys.executable, "-m", "tests.builders.compiled_loops")
    for process in [subprocess.Popen((*command, source), cwd=ROOT) for source in missing()]:
        process.wait()


if __name__ == "__main__":
    for name in sys.argv[1:] or LOOPS:
        LOOPS[name]()
