"""Exported C, compiled with every warning and every check, and driven by states from standard input."""

import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from tests.builders.studies import put_file

STRICT = ["-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wstrict-prototypes"]
WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", *STRICT]
CHECKS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

MAIN = """
{includes}
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **words)
{{
    double in[9];
    int model = count > 1 ? atoi(words[1]) : 0;
    while (fread(in, sizeof in, 1, stdin) == 1) {{
        double D[3][3], C[3][3], torque[3], body[3], out[28];
        int i;
        switch (model) {{
{models}
        default:
            return 2;
        }}
        for (i = 0; i < 9; ++i) {{
            out[4 + i] = D[i / 3][i % 3];
            out[13 + i] = C[i / 3][i % 3];
        }}
        for (i = 0; i < 3; ++i) {{
            out[22 + i] = torque[i];
            out[25 + i] = body[i];
        }}
        if (fwrite(out, sizeof out, 1, stdout) != 1)
            return 1;
    }}
    return 0;
}}
"""
MODEL = """\
        case {number}:
            out[0] = {name}_inertia(in, D);
            out[1] = {name}_coriolis(in, in + 3, C);
            out[2] = {name}_torque(in, in + 3, in + 6, torque, body);
            out[3] = {name}_inside(in);
            break;"""


@cache
def why_not():
    """Tell why nothing can be compiled here: no gcc, or none with its sanitisers."""
    if shutil.which("gcc") is None:
        return "no gcc on this machine"
    with TemporaryDirectory() as folder:
        probe = put_file(Path(folder) / "probe.c", "int main(void) { return 0; }\n")
        done = subprocess.run(["gcc", *CHECKS, probe, "-o", probe.with_name("probe")], capture_output=True, check=False)
    return "gcc has no sanitisers on this machine" if done.returncode else None


def require_gcc():
    """Skip where there is no gcc with its sanitisers."""
    if reason := why_not():
        pytest.skip(reason)


def build(folder, files, *flags, output="program"):
    """Compile; give the program, or fail with what the compiler says."""
    command = ["gcc", *WARNINGS, *flags, *(folder / file for file in files), "-lm", "-o", folder / output]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / output


def written(folder, stem, source):
    """Write exported C into a folder."""
    (folder / f"{stem}.c").write_text(source.source)
    (folder / f"{stem}.h").write_text(source.header)


def evaluate(folder, name, motion):
    """Compile exported C with all checks, and evaluate it along a motion."""
    return drive(driver(folder, [name]), motion)


def driver(folder, names):
    """Compile exported models with all checks into one program that takes states."""
    includes = "\n".join(f'#include "{name}.h"' for name in names)
    models = "\n".join(MODEL.format(number=number, name=name) for number, name in enumerate(names))
    (folder / "main.c").write_text(MAIN.format(includes=includes, models=models))
    return build(folder, ["main.c", *(f"{name}.c" for name in names)], "-O0", *CHECKS)


def drive(program, motion, model=0):
    """Evaluate one of the models of a program along a motion."""
    given = np.hstack([motion.attitude, motion.rate, motion.acceleration]).tobytes()
    done = subprocess.run([program, str(model)], input=given, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    out = np.frombuffer(done.stdout).reshape(len(motion), 28)
    return {
        "status": out[:, :3].astype(int),
        "inside": out[:, 3].astype(int),
        "D": out[:, 4:13].reshape(-1, 3, 3),
        "C": out[:, 13:22].reshape(-1, 3, 3),
        "torque": out[:, 22:25],
        "body": out[:, 25:28],
    }
