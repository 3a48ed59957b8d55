"""Draw what one simulated log of a racer in strong gusts shows of its control effectiveness, and the truth.

python benchmarks/look_picture.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads

pin_threads()

import numpy as np

from benchmarks.look_study import draw_case, log_of, simulate, truth
from cpfls_cli.look.effectiveness import effectiveness
from cpfls_cli.report.canvas import GREY, band, in_columns, line, plot, style_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "look-example.svg"


def main() -> None:
    rng = np.random.default_rng(7)
    case = draw_case(rng, "betaflight", "racer", "strong", "acro")
    (flown,) = simulate([case], 120.0, rng)
    plants = effectiveness(log_of(case, flown, "racer"))
    caption = "Angular acceleration per full command, by frequency."

    def draw(figure: Figure) -> None:
        for axes, plant in zip(in_columns(figure, 2, 2).ravel(), plants, strict=False):
            inside = plant.frequency <= plant.band_hz[1]
            hz, gain = plant.frequency[inside], plant.gain[inside]
            index = ("roll", "pitch").index(plant.axis)
            true = np.abs(truth(case, index, hz))
            filters = plant.model_gain[inside] / np.abs(plant.model.acceleration(hz))
            possible = (
                filters * np.abs(plant.possible.acceleration(hz)) if plant.identified else np.full((2, len(hz)), np.nan)
            )
            band(axes, hz, *np.quantile(possible, [0.025, 0.975], axis=0), color="#b8cde2", label="95 % interval")
            axes.plot(hz, gain, ".", color=style_of(0)["color"], markersize=4)
            line(axes, hz, plant.model_gain[inside], label="by the setpoint", **style_of(0))
            axes.plot(hz, plant.direct_gain[inside], color=GREY, linestyle="--", label="least squares")
            line(axes, hz, true, label="truth", color="black", linewidth=1.2)
            axes.set_title(plant.axis, color=GREY, fontsize="medium")
            axes.set_xlabel("Hz")
            axes.set_ylabel("rad/s² per full command")
            axes.set_ylim(0, 1.8 * true.max())
            axes.legend(loc="lower left", fontsize="small")

    OUTPUT.write_text(plot("look", caption, caption, 3.0, draw).picture.svg + "\n", encoding="utf-8")
    print(f"wrote {OUTPUT}")


if __name__ == "__main__":
    main()
