"""Draw docs/closed-loop.svg: the same flights in gusts without an instrument and with one.

    python benchmarks/instrument_picture.py

The vehicle of 45 g flies a path of 0.8 Hz at most four times in gusts of 3.4, 5.1 and 2 rad/s^2. Drawn are averages
over windows that see 0.5 to 1.5 Hz, about roll: what the rotors' torque would turn the true body by, and how it turned.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.playback.balances import BANDS, BANDS_HZ, band_windows
from cpfls_cli.playback.loop import wrench_during
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.canvas import GREY, in_columns, line, plot, style_of
from tests.builders.gusty_flights import GUSTS, SMALL, Flight, gusty_flights

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "closed-loop.svg"
RUNS, SECONDS = 4, 60.0
BAND = BANDS_HZ.index((0.5, 1.5))
GROUPS = 24
ENDS = np.array([-6.0, 6.0])
DRAWN = 4
"""Every which window is drawn; all count."""


def main() -> None:
    turned, turns = _averages()
    others = (turns.sum(axis=0) - turns) / (RUNS - 1)
    without = float((turns * turned).sum() / (turns**2).sum())
    with_ = float((others * turned).sum() / (others * turns).sum())
    rows = [("least squares", 1 / without), ("the other runs as instrument", 1 / with_)]
    table("instrument_picture", ("estimate", "Ixx over the true one"), rows)
    caption = "Roll of the same four runs, without an instrument and with one"
    description = (
        "Angular acceleration against what the torque of the rotors gives the true body: a cloud whose regression is "
        "flatter than the truth; and the same in groups by what the other runs did at that place of the path, which "
        "lie on the line of the true body"
    )

    def draw(figure: Figure) -> None:
        left, right = in_columns(figure, 2, 2, share_y=True).ravel()[:2]
        left.plot(
            turns[:, ::DRAWN].ravel(),
            turned[:, ::DRAWN].ravel(),
            ".",
            color=GREY,
            markersize=2.5,
            label="windows of the runs",
        )
        order = np.argsort(others.ravel())
        x, y = (_grouped(each.ravel()[order]) for each in (turns, turned))
        right.plot(x, y, "o", color="black", markersize=4, label="means of windows, by the other runs")
        for axes, slope, name in ((left, without, "least squares"), (right, with_, "other runs as instrument")):
            line(axes, ENDS, ENDS, color=GREY, linestyle="--", label="true body")
            line(axes, ENDS, slope * ENDS, label=f"{name}: {1 / slope:.2f} Ixx", **style_of(0))
            axes.set(xlabel="torque of the rotors over the true Ixx / (rad/s²)", xlim=ENDS, ylim=ENDS)
            axes.legend(loc="upper left", fontsize="small")
        left.set_ylabel("angular acceleration about roll / (rad/s²)")

    OUTPUT.write_text(plot("closed-loop", caption, description, 3.8, draw).picture.svg + "\n", encoding="utf-8")
    print(f"wrote {OUTPUT}")


def _averages() -> tuple[Array, Array]:
    """Average roll acceleration, and torque over the true inertia, in windows; shape (run, window)."""
    model, inertia, found = VehicleModel(vehicle=SMALL.vehicle), SMALL.inertia[0], []
    for flight in gusty_flights([Flight(SMALL, GUSTS, path=0, draw=run) for run in range(RUNS)], SECONDS):
        band, (whole,) = band_windows(flight.motion.period, *BANDS[BAND]), flight.stretches
        torque = wrench_during(model, flight, whole)[:, :1] / inertia
        found.append([band.derivative(flight.motion.rate[:, :1])[:, 0], band.average(torque)[:, 0]])
    turned, turns = np.array(found).swapaxes(0, 1)
    return turned, turns


def _grouped(values: Array) -> Array:
    return np.array([group.mean() for group in np.array_split(values, GROUPS)])


if __name__ == "__main__":
    main()
