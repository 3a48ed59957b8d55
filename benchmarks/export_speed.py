"""One evaluation of an exported model in C (gcc -O2) and in the library, many and one at a time; processor time."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.shared.measure import in_turn, program, table
from cpfls_cli.dynamics import CELLS, InertiaFunctions, coriolis_matrix
from cpfls_cli.export.points import reference_points
from cpfls_cli.export.source import c_source
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.regressor.regressor import Motion, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.exported_models import sheet_of
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.vehicle_models import HEXA, whole

BATCH, PASSES, SINGLES = 4096, 50, 50
BUDGET_NS = 10_000
PAPER = StructureSettings(consequents="seesaw", products="additive", membership_functions=5, input_map="data-range")
CASES = (
    ("the paper's: seesaw, 5 functions", PAPER),
    ("default: harmonic 2, tensor, 1 function", StructureSettings()),
    ("harmonic 2, tensor, 7 functions", StructureSettings(membership_functions=7)),
)
LOOPS = """
#include "m.h"
void inertia(const m_real *in, long n, m_real *sink) {
    m_real D[3][3];
    for (long i = 0; i < n; ++i) { m_inertia(in + 9 * i, D); *sink += D[2][2]; }
}
void coriolis(const m_real *in, long n, m_real *sink) {
    m_real C[3][3];
    for (long i = 0; i < n; ++i) { m_coriolis(in + 9 * i, in + 9 * i + 3, C); *sink += C[2][2]; }
}
void torque(const m_real *in, long n, m_real *sink) {
    m_real t[3], b[3];
    for (long i = 0; i < n; ++i) { m_torque(in + 9 * i, in + 9 * i + 3, in + 9 * i + 6, t, b); *sink += b[2]; }
}
"""

VEHICLE_LOOPS = """
#include "m.h"
#include <string.h>
enum { COLUMNS = 24 + M_ROTOR_TERMS };
void wrench(const m_real *in, long n, m_real *sink) {
    m_real t[3], f[3];
    for (long i = 0; i < n; ++i, in += COLUMNS) { m_wrench(in, in + 3, in + 24, t, f); *sink += t[0] + f[2]; }
}
void step(const m_real *in, long n, m_real *sink) {
    m_state s;
    for (long i = 0; i < n; ++i, in += COLUMNS) {
        memcpy(&s, in + 6, sizeof s);
        m_step(&s, in + 24, 0.01);
        *sink += s.rate[0];
    }
}
"""
VEHICLES = {
    "rotors alone": whole(effects=(), remainder=None),
    "all effects": whole(remainder=None),
    "all effects, learned part": whole(),
    "all effects, learned part, six rotors": whole(HEXA, order=0),
}


def main() -> None:
    rows, sizes = [], []
    for name, settings in CASES:
        model = random_model(settings)
        with tempfile.TemporaryDirectory() as folder:
            write(model, Path(folder))
            rows += [(name, call, *timed(model, Path(folder), call)) for call in ("inertia", "coriolis", "torque")]
            sizes.append((name, *size(model, Path(folder))))
    print("One evaluation, processor time; the library takes states in batches of 4096 or one at a time:\n")
    columns = (
        "structure | function | C, ns | C, float, ns | library, batch, ns | over C (range) | "
        f"library, one at a time, ns | one at a time over C (range) | C, share of {BUDGET_NS // 1000} us"
    )
    table("export_speed", columns, rows)
    print("\nWhat is stored:\n")
    columns = "structure | parameters | tables, bytes | the same, float | object file, bytes"
    table("export_size", columns, sizes)
    print("\nA whole vehicle in C, one evaluation:\n")
    table("export_vehicle_speed", "vehicle | torque and force, ns | step, ns | lines", map(vehicle_row, VEHICLES))


def vehicle_row(name: str) -> tuple[str, float, float, int]:
    """Time torque and force, and a step, of an exported vehicle, at states at random."""
    model, rng = VEHICLES[name], np.random.default_rng(1)
    points, still = reference_points(model, rng, BATCH), np.tile(np.eye(3).ravel(), (BATCH, 1))
    motion = rng.normal(0.0, 1.0, (BATCH, 9))
    states = np.hstack([points.air, points.rate, motion[:, :6], still, motion[:, 6:], points.rotor])
    with tempfile.TemporaryDirectory() as folder:
        source = c_source(sheet_of_vehicle(model, name="m"), "m")
        (Path(folder) / "m.c").write_text(source.source)
        (Path(folder) / "m.h").write_text(source.header)
        (Path(folder) / "loops.c").write_text(VEHICLE_LOOPS)
        gcc("-shared", "-fPIC", Path(folder) / "m.c", Path(folder) / "loops.c", "-lm", "-o", Path(folder) / "m.so")
        calls = [compiled(Path(folder) / "m.so", call, states) for call in ("wrench", "step")]
        found = in_turn(calls[1], calls[0])
    lines = len(source.source.splitlines())
    return name, *(1e9 * each / (PASSES * BATCH) for each in (found.fast_s, found.slow_s)), lines


def random_model(settings: StructureSettings) -> InertiaFunctions:
    """Draw coefficients; every angle lies in the range of the inputs, where most rules fire."""
    rng, structure = np.random.default_rng(1), model_structure(settings)
    ranges = (InputRange(-1.0, 1.0), InputRange(-1.0, 1.0))
    coefficients = rng.normal(0.0, 1.0, structure.parameters)
    visited = np.ones((CELLS, CELLS), dtype=bool)
    return InertiaFunctions(structure, ranges, uniform_breakpoints(structure), coefficients, np.zeros(6), visited)


def write(model: InertiaFunctions, folder: Path) -> None:
    """Export a model, and compile it in both precisions."""
    source = c_source(sheet_of(model, name="m"), "m")
    (folder / "m.c").write_text(source.source)
    (folder / "m.h").write_text(source.header)
    (folder / "loops.c").write_text(LOOPS)
    for kind, flags in (("double", []), ("float", ["-DCPFLS_FLOAT"])):
        both = [folder / "m.c", folder / "loops.c"]
        gcc("-shared", "-fPIC", *flags, *both, "-lm", "-o", folder / f"{kind}.so")
        gcc("-c", *flags, folder / "m.c", "-o", folder / f"{kind}.o")


def gcc(*words: str | Path) -> None:
    subprocess.run(["gcc", "-std=c99", "-O2", *words], check=True)


def timed(model: InertiaFunctions, folder: Path, call: str) -> tuple:
    """Time one function in C and in the library, in turn."""
    rng = np.random.default_rng(2)
    states = np.hstack([rng.uniform(-np.pi, np.pi, (BATCH, 3)), rng.normal(0, 3, (BATCH, 6))])
    double = compiled(folder / "double.so", call, states)
    single = compiled(folder / "float.so", call, states.astype(np.float32))
    alone = [library(model, call, states[index : index + 1]) for index in range(SINGLES)]
    pairs = ((library(model, call, states), double), (lambda: [one() for one in alone], double), (double, single))
    many, one, in_float = (in_turn(slow, fast) for slow, fast in pairs)
    c, floats = (1e9 * each.fast_s / (PASSES * BATCH) for each in (many, in_float))
    batch, single_s = 1e9 * many.slow_s / BATCH, 1e9 * one.slow_s / SINGLES
    shares = scaled(many, PASSES), scaled(one, PASSES * BATCH / SINGLES)
    return c, floats, batch, shares[0], single_s, shares[1], f"{c / BUDGET_NS:.1%}"


def scaled(ratio, factor: float) -> str:
    """Compare single evaluations where the two did different numbers of them."""
    return f"{factor * ratio.ratio:.3g} ({factor * ratio.lowest:.3g} to {factor * ratio.highest:.3g})"


def compiled(path: Path, call: str, states: np.ndarray):
    """Evaluate all states, several times."""
    function = getattr(ctypes.CDLL(str(path)), call)
    function.argtypes = [ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p]
    function.restype = None
    states, sink = np.ascontiguousarray(states), np.zeros(1, states.dtype)

    def run() -> None:
        for _ in range(PASSES):
            function(states.ctypes.data, len(states), sink.ctypes.data)

    return run


def library(model: InertiaFunctions, call: str, states: np.ndarray):
    """Evaluate states together."""
    q, qd, qdd = np.split(states, 3, axis=1)
    if call == "torque":
        return partial(model.torque, Motion(q, qd, qdd))
    if call == "inertia":
        return partial(model.inertia, q)
    return lambda: coriolis_matrix(model.inertia(q), qd)


def size(model: InertiaFunctions, folder: Path) -> tuple[int, int, int, int]:
    """Count numbers of the tables and the bytes of the object file."""
    structure = model.structure
    used = any(block.rules > 1 for block in structure.blocks)
    numbers = structure.parameters + (sum(p.functions for p in structure.partitions) if used else 0)
    region = CELLS * CELLS // 8
    text = subprocess.run(["size", folder / "double.o"], capture_output=True, text=True, check=True).stdout
    loaded = int(text.splitlines()[1].split()[0])
    return structure.parameters, 8 * numbers + region, 4 * numbers + region, loaded


if __name__ == "__main__":
    program(main)
