"""Logs of a study as autopilots write them by default: rows repeat rotors, motion and attitude between rare updates."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

RATES_HZ = {"om": 10.0, "phi": 20.0, "theta": 20.0, "psi": 20.0, "x": 10.0, "y": 10.0, "z": 10.0, "v": 10.0}
"""Updates a second of columns by what they begin with; others change in each row."""
_AS_LOGGED = ("volt", "xd", "yd", "zd", "vxd", "vyd", "vzd")


def thinned(folder):
    """Copy the flights and keys of a study to a folder next to it with thinned logs; gives that folder."""
    folder = Path(folder)
    out = folder.with_name(f"{folder.name}-thinned")
    shutil.copytree(folder / "keys", out / "keys", dirs_exist_ok=True)
    for logs in sorted((folder / "flights").iterdir()):
        own = shutil.copytree(logs, out / "flights" / logs.name, dirs_exist_ok=True)
        for number, path in enumerate(sorted(own.glob("*.csv"))):
            _thin(path, np.random.default_rng(number))
    return out


def _thin(path, rng):
    names = path.read_text(encoding="ascii").partition("\n")[0].split(",")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    period, rows = np.median(np.diff(table[:, 0])), np.arange(len(table))
    # Columns of one rate are one topic, which begins at a moment of its own.
    begun = {hz: rng.uniform(0, 1 / hz) for hz in (10.0, 20.0)}
    for column, name in enumerate(names):
        hz = next((own for begin, own in RATES_HZ.items() if name.startswith(begin)), None)
        if hz is None or name in _AS_LOGGED:
            continue
        updates = np.arange(begun[hz] - 1 / hz, rows[-1] * period, 1 / hz) / period
        updates = np.unique(np.clip(np.round(updates).astype(int), 0, len(rows) - 1))
        table[:, column] = table[updates[np.searchsorted(updates, rows, side="right") - 1], column]
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
