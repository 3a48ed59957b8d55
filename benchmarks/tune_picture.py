"""Draw what PX4 does with a quadrotor of 1.2 kg: steps in gusts beside their prediction, with two sets of gains.

python benchmarks/tune_picture.py
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads

pin_threads()


from benchmarks.tune import NOISE, SPREAD, VEHICLES, gusts_of
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.report.canvas import BASELINE, GREY, band, in_columns, line, plot, style_of
from cpfls_cli.tuning.gains import AskedMargins, with_filters
from cpfls_cli.tuning.margins import evaluate
from cpfls_cli.tuning.plant import hover_plant
from tests.builders.autopilots import flown_step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "tune.svg"


def main() -> None:
    (vehicle, lag), autopilot = VEHICLES["1.2 kg"], AUTOPILOTS["px4"]
    hover = replace(hover_plant(autopilot.law(), vehicle, None, lag), spreads=(SPREAD,) * 3)
    found = with_filters(autopilot, autopilot.defaults(), hover, AskedMargins()).proposals
    sets = {
        "default gains": autopilot.defaults(),
        "gains of cpfls tune": autopilot.defaults() | {each.parameter.name: each.value for each in found},
    }
    evaluated = {name: evaluate(autopilot.law(values), hover) for name, values in sets.items()}
    seen = {
        name: flown_step("px4", values, vehicle, lag, 0, gusts=gusts_of(vehicle), noise=NOISE)
        for name, values in sets.items()
    }
    caption = "Roll after a step of the asked angle, in parts of it: predicted, and flown in gusts by the true vehicle."

    def draw(figure: Figure) -> None:
        for axes, name in zip(in_columns(figure, 2, 2, share_y=True).ravel(), sets, strict=True):
            own, time = evaluated[name].roll, 1e3 * evaluated[name].time
            band(axes, time, own.step_low, own.step_high, color="#c9c9c9", label="vehicles that are possible")
            line(axes, time, own.step, label="predicted", **style_of(0))
            flown = seen[name]
            axes.plot(1e3 * flown.time[::12], flown.angle[::12, 0], ".", color="black", markersize=4, label="flown")
            axes.axhline(1.0, **BASELINE)
            margin = own.command_worst
            axes.set_title(f"{name}: {margin.phase_deg:.0f}°, {margin.gain_db:.0f} dB", color=GREY, fontsize="medium")
            axes.set_xlabel("ms")
            axes.set_ylim(-0.1, 1.5)
            axes.legend(loc="lower right", fontsize="small")

    OUTPUT.write_text(plot("tune", caption, caption, 3.0, draw).picture.svg + "\n", encoding="utf-8")
    print(f"wrote {OUTPUT}")


if __name__ == "__main__":
    main()
