"""Exported C, compiled with every warning and every check, and driven by states from standard input."""

import shutil
import subprocess

import numpy as np
import pytest

STRICT = ["-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wstrict-prototypes"]
WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", *STRICT]
MANY = 10_000
CHECKS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

MAIN = """
#include "{stem}.h"
#include <stdio.h>

int main(void)
{{
    double in[9];
    while (fread(in, sizeof in, 1, stdin) == 1) {{
        double D[3][3], C[3][3], torque[3], body[3], out[28];
        int i;
        out[0] = {name}_inertia(in, D);
        out[1] = {name}_coriolis(in, in + 3, C);
        out[2] = {name}_torque(in, in + 3, in + 6, torque, body);
        out[3] = {name}_inside(in);
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


def require_gcc(folder):
    """Skip where there is no gcc with its sanitisers."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc on this machine")
    probe = folder / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    done = subprocess.run(["gcc", *CHECKS, probe, "-o", folder / "probe"], capture_output=True, check=False)
    if done.returncode:
        pytest.skip("gcc has no sanitisers on this machine")


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


def evaluate(folder, stem, name, motion):
    """Compile exported C with all checks, and evaluate it along a motion."""
    # Optimising takes longer than it saves on few states.
    return drive(driver(folder, stem, name, "-O1" if len(motion) > MANY else "-O0"), motion)


def driver(folder, stem, name, optimised="-O0"):
    """Compile exported C with all checks into a program that takes states."""
    (folder / "main.c").write_text(MAIN.format(stem=stem, name=name))
    return build(folder, [f"{stem}.c", "main.c"], optimised, *CHECKS)


def drive(program, motion):
    """Evaluate a compiled model along a motion."""
    given = np.hstack([motion.attitude, motion.rate, motion.acceleration]).tobytes()
    done = subprocess.run([program], input=given, capture_output=True, check=False)
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
