"""What is predicted of gains, against flights of the true vehicle by the autopilot's law, in gusts and noise."""

import numpy as np
import pytest

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.tuning.gains import AskedMargins, with_filters
from cpfls_cli.tuning.margins import evaluate
from cpfls_cli.tuning.plant import hover_plant
from tests.builders.autopilots import CROSS, flown_margins, flown_step

LAG = 0.03
GUSTS = Gusts(np.array([2.0, 2.0, 0.2, 0, 0, 0]) * [*CROSS.inertia_kg_m2, 0, 0, 0], np.full(6, 0.3))


@pytest.mark.parametrize("gains", ["default", "tuned"])
def test_margins_and_step_are_flown_as_predicted(gains):
    autopilot = AUTOPILOTS["px4"]
    values = autopilot.defaults()
    hover = hover_plant(autopilot.law(), CROSS, None, LAG)
    if gains == "tuned":
        found = with_filters(autopilot, values, hover, AskedMargins()).proposals
        values |= {each.parameter.name: each.value for each in found}
    own = evaluate(autopilot.law(values), hover).roll
    same = {"gusts": GUSTS, "noise": 0.01}
    lowest = 0.5 * own.command.crossover_hz
    gain, phase = flown_margins("px4", values, CROSS, LAG, 0, lowest_hz=lowest, periods=3, **same)
    assert gain == pytest.approx(own.command.gain_db, abs=1.5)
    assert phase == pytest.approx(own.command.phase_deg, abs=6.0)
    step = flown_step("px4", values, CROSS, LAG, 0, steps=1, held_s=1.5, **same)
    assert step.overshoot[0] == pytest.approx(own.overshoot, abs=0.12)
    assert step.rise_s[0] == pytest.approx(own.rise_s, rel=0.25)
    # The defaults do not hold what is asked with this vehicle, and the flight shows it.
    assert (phase > 40.0) == (gains == "tuned")
