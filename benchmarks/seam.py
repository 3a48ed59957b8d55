"""Draw docs/seam.svg: torque where the angles close their circle and where the seesaw folds.

    python benchmarks/seam.py

Two systems of the same rules, seesaw and harmonic consequents, learn the torque of the paper's vehicle from random
states over the whole circle. Then roll, and after it pitch, turns slowly through the circle.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from matplotlib.figure import Figure

from benchmarks.shared.full_circle import INERTIA, random_states, torque_data, uniform_model
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.report.canvas import GREY, legend_above, line, plain_ticks, plot, stacked, style_of

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "seam.svg"
SYSTEMS = {
    "seesaw, 113 parameters": IdentificationSettings(
        consequents="seesaw", products="additive", membership_functions=5, base="none"
    ),
    "harmonic, 185 parameters": IdentificationSettings(
        consequents="harmonic", harmonic_order=1, products="additive", membership_functions=5, base="none"
    ),
}
SWEPT = ("roll", "pitch")
RATE = np.array([[1.0, 0.4, 0.8], [0.4, 1.0, 0.8]])
OTHER = np.array([0.5, 0.5])
FOLDS = np.pi * np.array([0.5, 1.5])
STEP = 1e-9


def swept(angle: int, values: np.ndarray) -> Motion:
    """Turn roll (0) or pitch (1) at a steady rate while the other angle stands at 0.5 rad."""
    attitude = np.zeros((len(values), 3))
    attitude[:, 1 - angle], attitude[:, angle] = OTHER[angle], np.mod(values, 2 * np.pi)
    return Motion(attitude, np.tile(RATE[angle], (len(values), 1)), np.zeros((len(values), 3)))


def jumps(torque, angle: int) -> dict[str, list[float]]:
    """Change of the torque that is drawn, and the largest of all three, over 2e-9 rad at 0, pi/2, pi and 3 pi/2."""
    places = 0.5 * np.pi * np.arange(4)
    sides = [torque(swept(angle, places + side * STEP)) for side in (-1, 1)]
    change = np.abs(sides[1] - sides[0])
    return {f"about {SWEPT[angle]}": change[:, angle].tolist(), "largest": np.max(change, axis=1).tolist()}


def main() -> None:
    models = {name: uniform_model(random_states(1), settings).model for name, settings in SYSTEMS.items()}
    rows = [
        (f"{name.partition(',')[0]}, {SWEPT[angle]} turns: {which}", *changes)
        for name, model in models.items()
        for angle in (0, 1)
        for which, changes in jumps(model.torque, angle).items()
    ]
    table("seam", ("change of torque / N m at", "0", "pi/2", "pi", "3 pi/2"), rows)
    caption = "Torque along slow turns of roll and pitch"
    description = (
        "Torque about roll along a turn of roll, and about pitch along a turn of pitch: the harmonic system is smooth, "
        "the seesaw system jumps at 90 and 270 degrees, neither jumps at 0 and 360 degrees"
    )
    OUTPUT.write_text(plot("seam", caption, description, 5.0, lambda figure: draw(figure, models)).picture.svg + "\n")
    print(f"wrote {OUTPUT}")


def draw(figure: Figure, models) -> None:
    angles = np.linspace(-0.25 * np.pi, 2.25 * np.pi, 6001)
    for angle, axes in enumerate(stacked(figure, 2)):
        motion = swept(angle, angles)
        exact = torque_data(motion, INERTIA).torque[:, angle]
        line(axes, angles, exact, color=GREY, linewidth=3.5, alpha=0.55, label="rigid body, exact")
        for index, (name, model) in enumerate(models.items()):
            line(axes, angles, model.torque(motion)[:, angle], label=name, **style_of(1 - index))
        for fold in FOLDS:
            axes.axvline(fold, color="black", linewidth=0.6, linestyle=":")
        axes.set_ylabel(f"torque about {SWEPT[angle]}, N m")
        axes.set_xlabel(f"{SWEPT[angle]}; the other angle at {OTHER[angle]:g} rad")
        axes.set_xticks(0.5 * np.pi * np.arange(5), ["0", "π/2", "π", "3π/2", "2π"])
        axes.tick_params(labelbottom=True)
        plain_ticks(axes.yaxis)
        if angle == 0:
            legend_above(axes, columns=3)


if __name__ == "__main__":
    main()
