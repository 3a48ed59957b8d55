"""What is said of frequency responses: first whether the model answers as the vehicle does, then where it is off."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.artifacts.response import ResponseRecord
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.pages.response import answer, bode_figure, response_box
from cpfls_cli.report.content import Table
from cpfls_cli.response.flown import VehicleResponse
from cpfls_cli.response.mismatch import mismatch
from cpfls_cli.response.spectra import FrequencyResponse
from tests.builders.forms import in_all_forms, phrases, source_of_record, words

FREQUENCY = 10.0 ** (np.arange(-18, 29) / 24)


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


def record_of(instruments="repeats", contradictions=None, **estimates):
    responses = [VehicleResponse(name.replace("_", " "), each, mismatch(each)) for name, each in estimates.items()]
    made = ResponseRecord.of("vehicle.h5", ["a.csv", "b.csv"], instruments, responses, ["b.csv: odd"], contradictions)
    return made.with_header(Header("0", 0, resolved_yaml(Study()), {}))


STRONG_BELOW = np.where(FREQUENCY < 1.0, 2.5, 1.0)
LATE_ABOVE = np.where(FREQUENCY > 5.0, np.exp(-1j * np.radians(40)), 1.0)


def test_a_good_model():
    box = response_box(record_of(roll=estimate(), pitch=estimate(1.1)))
    assert box.title == "vehicle.h5 answers its rotors as the vehicle does: roll and pitch."
    assert box.tone == "good"
    assert box.sentences[0] == "Roll: good, J = 0 from 0.18 to 15 Hz; right throughout."


def test_a_model_that_is_off_is_told_where():
    record = record_of(
        roll=estimate(), pitch=estimate(STRONG_BELOW), yaw=estimate(LATE_ABOVE), thrust=estimate(1, 0.4, error=0.3)
    )
    box = response_box(record)
    assert box.title == "vehicle.h5 does not answer as the vehicle does: pitch and yaw; not judged: thrust."
    assert box.tone == "warning"
    assert "2.5 times too strong from 0.18 to 0.91 Hz, right from 1.0 to 15 Hz" in box.sentences[1]
    assert "right from 0.18 to 4.6 Hz, 40° too late (13 ms) from 5.1 to 15 Hz" in box.sentences[2]
    assert (
        box.sentences[3] == "Thrust: not judged, nowhere a coherence above 0.6, or of a random error of less than 10 %."
    )
    assert [record.word(index) for index in range(4)] == ["good", "not-acceptable", "not-acceptable", "not-judged"]


def test_without_instruments_nothing_is_judged():
    record = record_of(
        "none", roll=estimate(instrumented=False), rotor_speed=estimate(1.0, lag_s=0.05, instrumented=False)
    )
    box = response_box(record)
    assert box.title == "vehicle.h5: not judged: these flights show the loop, not the vehicle."
    assert "fly the same path several times" in box.sentences[0]
    assert box.sentences[1].startswith("Roll: of the loop: J = 0 ")
    # Speeds that follow commands feel no gust.
    assert box.sentences[2].startswith("Rotor speed: good, J = 0 ")
    assert record.summary["responses"]["roll"]["word"] == "not-judged"


def test_what_no_model_says_is_told_by_its_lag():
    box = response_box(record_of(roll_rate=estimate(lag_s=0.05, model=False), pitch_rate=estimate(model=False)))
    assert box.title == (
        "vehicle.h5 cannot be judged: the paths that are flown again move no response clearly, and what moves by "
        "itself is of the loop."
    )
    # A lag of 50 ms is 45 degrees behind at 1 / (2 pi 50 ms).
    assert box.sentences[0] == "Roll rate: 45° behind what is asked at 3.2 Hz, seen from 0.18 to 15 Hz."
    assert box.sentences[1] == "Pitch rate: follows what is asked less than 45° behind from 0.18 to 15 Hz."


def test_a_contradiction_comes_first():
    box = response_box(record_of(contradictions=("a.csv: the gyroscope is mirrored",), roll=estimate()))
    assert box.title == "The log contradicts itself: a.csv: the gyroscope is mirrored."
    assert box.tone == "warning"


@pytest.mark.parametrize("instruments", ["repeats", "none"])
def test_the_report_says_what_the_command_says(instruments):
    source = source_of_record(
        record_of(instruments, roll=estimate(), pitch=estimate(STRONG_BELOW, instrumented=instruments != "none")),
        "response.h5",
    )
    blocks = tuple(answer(source))
    said = [phrase for block in blocks if not isinstance(block, Table) for phrase in phrases(block)]
    for form, text in in_all_forms(source, blocks).items():
        assert [each for each in said if words(each) not in words(text) and each != "b.csv: odd"] == [], form


def test_bode_plots_hold_the_curves():
    record = record_of(
        roll=estimate(0.5, np.where(FREQUENCY < 5, 0.9, 0.2), error=np.where(FREQUENCY < 5, 0.02, 0.4)),
        yaw=estimate(np.nan),
    )
    upper, middle, lower = bode_figure("roll", record, 0).picture.panels
    curves = {series.label: series for series in upper.series}
    assert {"95 %", "not excited", "without instruments", "vehicle", "model"} == set(curves)
    clear = np.isfinite(curves["vehicle"].y)
    assert curves["vehicle"].x[clear].max() < 5.0
    apart = curves["model"].y[clear] - curves["vehicle"].y[clear]
    assert apart == pytest.approx(20 * np.log10(0.5) * np.ones(clear.sum()))
    assert middle.y_label == "degrees"
    assert lower.x_label == "Hz"
    assert "<svg" in bode_figure("yaw", record, 1).picture.svg


def test_files_of_a_newer_program_keep_their_word():
    record = replace(record_of(roll=estimate()), instruments="balloons")
    assert record.has_instruments
    assert response_box(record).tone == "good"


def test_a_response_that_one_flight_lacks_is_not_judged_beside_others():
    record = record_of(roll=estimate(), thrust=estimate(2.0, instrumented=False))
    box = response_box(record)
    assert box.title == "vehicle.h5 answers its rotors as the vehicle does: roll; not judged: thrust."
    assert box.tone == "note"
    assert box.sentences[1].startswith("Thrust: not moved by the paths that are flown again, so of the loop: J = ")
    assert record.summary["responses"]["thrust"]["instrumented"] is False
