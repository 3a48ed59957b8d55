"""Exported vehicles in all forms, each evaluated by the same calls: C is compiled with all checks, JSON as it says."""

import json
import math
import subprocess

import numpy as np

from cpfls_cli.artifacts.gate import Origin
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import c_source, python_source
from tests.builders.compiled_c import CHECKS, build, written
from tests.builders.exported_models import short_runs

MAIN = """
#include "vehicle.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROTORS = VEHICLE_ROTORS, TERMS = VEHICLE_ROTOR_TERMS };

static int put(const double *values, size_t count)
{
    return fwrite(values, sizeof *values, count, stdout) == count ? 0 : 1;
}

static int wrenches(void)
{
    double in[6 + TERMS], out[7];
    while (fread(in, sizeof in, 1, stdin) == 1) {
        out[6] = vehicle_wrench(in, in + 3, in + 6, out, out + 3);
        if (put(out, 7))
            return 1;
    }
    return 0;
}

static int steps(double period)
{
    double in[18 + TERMS], out[26];
    while (fread(in, sizeof in, 1, stdin) == 1) {
        vehicle_state s;
        memcpy(&s, in, sizeof s);
        out[24] = vehicle_accelerations(&s, in + 18, out, out + 3);
        out[25] = vehicle_step(&s, in + 18, period);
        memcpy(out + 6, &s, sizeof s);
        if (put(out, 26))
            return 1;
    }
    return 0;
}

static int rotors(double period, int held)
{
    double in[2 * ROTORS], out[TERMS + 1];
    vehicle_rotors r;
    int begun = 0;
    while (fread(in, sizeof in, 1, stdin) == 1) {
        unsigned status = begun ? 0u : vehicle_rotors_begin(&r, in, period);
        begun = 1;
        out[TERMS] = status | vehicle_rotors_step(&r, in, held ? 0 : in + ROTORS, out);
        if (put(out, TERMS + 1))
            return 1;
    }
    return 0;
}

int main(int count, char **words)
{
    const double period = atof(words[2]);
    if (words[1][0] == 'w')
        return wrenches();
    return words[1][0] == 's' ? steps(period) : rotors(period, count > 3);
}
"""


ORIGIN = Origin(stage="vehicle", seed=1, config="seed: 1\n", version="0.1.0")


def sheet_of_vehicle(model, name="vehicle", **changed):
    """Put a vehicle on a sheet."""
    given = {"usage": ("It is worth a test.",), "origin": ORIGIN, "file": "vehicle.h5"}
    return Sheet(name=name, model=model, sha256="a" * 64, **(given | changed))


def flat(state):
    """Arrange states for C: position, velocity, rotation, rate."""
    return np.hstack([part.reshape(len(part), -1) for part in state])


class InC:
    """A vehicle as compiled C."""

    def __init__(self, folder, model, *flags):
        with short_runs():
            written(folder, "vehicle", c_source(sheet_of_vehicle(model), "vehicle"))
        (folder / "main.c").write_text(MAIN)
        self.program = build(folder, ["main.c", "vehicle.c"], *(flags or CHECKS))

    def _drive(self, given, columns, *words):
        command = [self.program, *words]
        done = subprocess.run(command, input=np.ascontiguousarray(given).tobytes(), capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()
        return np.frombuffer(done.stdout).reshape(len(given), columns)

    def statuses(self, kind, given, columns, *words):
        """Give the last column, which says what speaks against a result."""
        return self._drive(given, columns, kind, *words)

    def wrench(self, air, rate, rotor):
        out = self._drive(np.hstack([air, rate, rotor]), 7, "w", "0")
        assert not out[:, 6].any()
        return out[:, :6]

    def motion(self, state, rotor, period):
        """Accelerations (6 columns), then the states after a step."""
        out = self._drive(np.hstack([flat(state), rotor]), 26, "s", repr(period))
        assert not out[:, 24:].any()
        return out[:, :6], out[:, 6:24]

    def rotor_terms(self, speed, period, hold):
        following = np.vstack([speed[1:], speed[-1:]])
        words = ("held",) if hold == "previous" else ()
        out = self._drive(np.hstack([speed, following]), 2 + 4 * speed.shape[1], "r", repr(period), *words)
        assert not out[:, -1].any()
        return out[:, :-1]


def on_numpy(text):
    """Run functions for JAX on NumPy, which has all that they call but what batches and differentiates."""
    names = {"__name__": "vehicle"}
    with_jax = "import jax\nimport jax.numpy as jnp\n"
    assert with_jax in text
    exec(text.replace(with_jax, "import numpy as jnp\n"), names)
    return names


class InJax:
    """A vehicle as functions for JAX, run on NumPy, one sample after the other."""

    def __init__(self, _folder, model):
        self.names = on_numpy(python_source(sheet_of_vehicle(model), "vehicle.py", "jax"))

    def wrench(self, air, rate, rotor):
        return np.array([self.names["wrench"](*row) for row in zip(air, rate, rotor, strict=True)])

    def motion(self, state, rotor, period):
        rows = list(zip(flat(state), rotor, strict=True))
        accelerations = [self.names["accelerations"](*row) for row in rows]
        return np.array(accelerations), np.array([self.names["step"](*row, period) for row in rows])

    def rotor_terms(self, speed, period, hold):
        memory, rows = self.names["rotors_begin"](speed[0], period), []
        for now, following in zip(speed, [*speed[1:], speed[-1]], strict=True):
            memory, terms = self.names["rotors_step"](memory, now, following, period, hold == "previous")
            rows.append(terms)
        return np.array(rows)


class InJson:
    """A vehicle as JSON, evaluated by what its words say and slowly."""

    def __init__(self, _folder, model):
        self.document = json.loads(json_text(sheet_of_vehicle(model)))
        self.mass, self.gravity = self.document["mass_kg"], self.document["gravity_m_s2"]
        self.inertia = np.array(self.document["inertia_kg_m2"])

    def wrench(self, air, rate, rotor):
        return np.array([self._wrench(*row) for row in zip(air, rate, rotor, strict=True)])

    def _wrench(self, air, rate, rotor):
        assert len(rotor) == len(self.document["terms_of_rotors"])
        functions = {name: getattr(math, name) for name in ("sqrt", "exp", "sin", "cos", "atan2", "floor")}
        names = functions | {name: each["value"] for name, each in self.document["numbers"].items()}
        names |= {"air": air.tolist(), "rate": rate.tolist(), "rotor": rotor.tolist()}
        if self.document["learned"]:
            names["learned"] = self.document["learned"]["coefficients"]
        exec("\n".join(self.document["wrench"]["lines"]), names)
        return np.array([eval(component, names) for component in self.document["wrench"]["components"]])

    def motion(self, state, rotor, period):
        rows = [self._moved(*parts, period) for parts in zip(*state, rotor, strict=True)]
        return tuple(map(np.array, zip(*rows, strict=True)))

    def _accelerations(self, velocity, rotation, rate, rotor):
        wrench = self._wrench(rotation.T @ velocity, rate, rotor)
        linear = [0.0, 0.0, -self.gravity] + rotation @ wrench[3:] / self.mass
        return linear, np.linalg.solve(self.inertia, wrench[:3] - np.cross(rate, self.inertia @ rate))

    def _moved(self, position, velocity, rotation, rate, rotor, period):
        first = self._accelerations(velocity, rotation, rate, rotor)
        v, w = velocity + period / 2 * first[0], rate + period / 2 * first[1]
        linear, angular = self._accelerations(v, rotation @ turn(period / 2 * rate), w, rotor)
        after = (
            position + period * v,
            velocity + period * linear,
            rotation @ turn(period * w),
            rate + period * angular,
        )
        return np.concatenate(first), np.concatenate([part.ravel() for part in after])


def turn(vector):
    """The rotation by a vector, as a series."""
    x, y, z = vector
    cross, term, total = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.eye(3), np.eye(3)
    for k in range(1, 30):
        term = term @ cross / k
        total = total + term
    return total


FORMS = {"c": InC, "jax": InJax, "json": InJson}
