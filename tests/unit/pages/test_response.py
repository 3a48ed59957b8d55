"""What is said of frequency responses: first whether the model answers as the vehicle does, then where it is off."""

import numpy as np
import pytest

from cpfls_cli import page
from cpfls_cli.report.canvas import picture_of
from cpfls_cli.report.content import Box, Folded
from cpfls_cli.response.flown import Responses, VehicleResponse
from cpfls_cli.response.spectra import ROTOR_SPEED, FrequencyResponse, mismatch
from cpfls_cli.result import plain
from cpfls_cli.stage import loaded
from cpfls_cli.store import findings

FREQUENCY = 10.0 ** (np.arange(-18, 29) / 24)
STRONG_BELOW = np.where(FREQUENCY < 1.0, 2.5, 1.0)
LATE_ABOVE = np.where(FREQUENCY > 5.0, np.exp(-1j * np.radians(40)), 1.0)


def estimate(ratio=1.0, coherence=0.95, lag_s=0.0, model=True, error=0.02, instrumented=True):
    gain = 5.0 / (1 + 2j * np.pi * FREQUENCY * lag_s) * np.ones_like(FREQUENCY)
    return FrequencyResponse(
        frequency=FREQUENCY,
        gain=gain,
        model=gain * ratio if model else None,
        direct=0.5 * gain,
        coherence_input=np.broadcast_to(coherence, FREQUENCY.shape),
        coherence_output=np.broadcast_to(coherence, FREQUENCY.shape),
        random_error=np.broadcast_to(error, FREQUENCY.shape),
        averages=np.full(len(FREQUENCY), 12.0),
        instrumented=instrumented,
    )


def result_of(instruments="repeats", contradictions=(), **estimates):
    named = {name.replace("_", " "): each for name, each in estimates.items()}
    responses = {
        name: VehicleResponse(**vars(each), **vars(mismatch(each)), of_vehicle=each.instrumented or name == ROTOR_SPEED)
        for name, each in named.items()
    }
    made = Responses(
        model="vehicle.h5",
        flights=("a.csv", "b.csv"),
        instruments=instruments,
        responses=responses,
        warnings=("b.csv: odd",),
        contradictions=contradictions,
    )
    assert findings(made) == []
    return made


def answer(made):
    """The verdict, and what is said of each response."""
    blocks = page.blocks(loaded("response").text(made))
    (box,) = [each for each in blocks if isinstance(each, Box)]
    folds = {each.summary: each.blocks for each in blocks if isinstance(each, Folded)}
    return box, [each.text for each in folds["each response in words"]]


def test_a_good_model():
    box, said = answer(result_of(roll=estimate(), pitch=estimate(1.1)))
    assert (box.label, box.tone) == ("RESPONSE", "good")
    assert box.title == "vehicle.h5 answers its rotors as the vehicle does: roll and pitch."
    assert said[0] == "Roll: good, J = 0 from 0.18 to 15 Hz; right throughout."


def test_a_model_that_is_off_is_off_somewhere():
    made = result_of(
        roll=estimate(), pitch=estimate(STRONG_BELOW), yaw=estimate(LATE_ABOVE), thrust=estimate(1, 0.4, error=0.3)
    )
    box, said = answer(made)
    assert box.title == "vehicle.h5 does not answer as the vehicle does: pitch and yaw; not judged: thrust."
    assert box.tone == "warning"
    assert "2.5 times too strong from 0.18 to 0.91 Hz, right from 1.0 to 15 Hz" in said[1]
    assert "right from 0.18 to 4.6 Hz, 40° too late (13 ms) from 5.1 to 15 Hz" in said[2]
    assert said[3] == "Thrust: not judged, nowhere a coherence above 0.6, or of a random error of less than 10 %."
    assert [each.word for each in made.responses.values()] == ["good", "not-acceptable", "not-acceptable", "not-judged"]


def test_without_instruments_nothing_is_judged():
    made = result_of(
        "none", roll=estimate(instrumented=False), rotor_speed=estimate(1.0, lag_s=0.05, instrumented=False)
    )
    box, said = answer(made)
    assert box.title == "vehicle.h5: not judged: these flights show the loop, not the vehicle."
    assert "fly the same path several times" in said[0]
    assert said[1].startswith("Roll: of the loop: J = 0 ")
    # Speeds that follow commands feel no gust.
    assert said[2].startswith("Rotor speed: good, J = 0 ")
    assert made.responses["roll"].word == "not-judged"


def test_what_no_model_says_is_said_by_its_lag():
    box, said = answer(result_of(roll_rate=estimate(lag_s=0.05, model=False), pitch_rate=estimate(model=False)))
    assert box.title == (
        "vehicle.h5 cannot be judged: the paths that are flown again move no response clearly, and what moves by "
        "itself is of the loop."
    )
    # A lag of 50 ms is 45 degrees behind at 1 / (2 pi 50 ms).
    assert said[0] == "Roll rate: 45° behind what is asked at 3.2 Hz, seen from 0.18 to 15 Hz."
    assert said[1] == "Pitch rate: follows what is asked less than 45° behind from 0.18 to 15 Hz."


def test_a_contradiction_comes_first():
    wrong = ("a.csv: the gyroscope is mirrored", "b.csv: so is this")
    box, _ = answer(result_of(contradictions=wrong, roll=estimate()))
    assert box.title == "The log contradicts itself: a.csv: the gyroscope is mirrored."
    assert (box.sentences, box.tone) == (("b.csv: so is this.",), "warning")


@pytest.mark.usefixtures("drawn")
def test_bode_plots_hold_the_curves():
    made = result_of(
        roll=estimate(0.5, np.where(FREQUENCY < 5, 0.9, 0.2), error=np.where(FREQUENCY < 5, 0.02, 0.4)),
        yaw=estimate(np.nan),
    )
    figures = loaded("response").figures
    upper, middle, lower = picture_of(figures["roll"], "roll", made).figure().axes
    curves = {curve.get_label(): curve for curve in (*upper.lines, *upper.collections, *upper.patches)}
    assert {"95 %", "not excited", "without instruments", "vehicle", "model"} <= set(curves)
    clear = np.isfinite(curves["vehicle"].get_ydata())
    assert curves["vehicle"].get_xdata()[clear].max() < 5.0
    apart = curves["model"].get_ydata()[clear] - curves["vehicle"].get_ydata()[clear]
    assert apart == pytest.approx(20 * np.log10(0.5) * np.ones(clear.sum()))
    assert middle.get_ylabel() == "degrees"
    assert lower.get_xlabel() == "Hz"
    assert "<svg" in picture_of(figures["yaw"], "yaw", made).svg
    assert picture_of(figures["thrust"], "thrust", made) is None


def test_a_response_that_one_flight_lacks_is_not_judged_next_to_others():
    made = result_of(roll=estimate(), thrust=estimate(2.0, instrumented=False))
    box, said = answer(made)
    assert box.title == "vehicle.h5 answers its rotors as the vehicle does: roll; not judged: thrust."
    assert box.tone == "note"
    assert said[1].startswith("Thrust: not moved by the paths that are flown again, so of the loop: J = ")
    assert plain(made)["responses"]["thrust"]["instrumented"] is False
