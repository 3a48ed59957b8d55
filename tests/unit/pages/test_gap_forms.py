"""What the commands of the gap workflow say stands in every form of the report, in the same words and numbers."""

import numpy as np
import pytest

from cpfls_cli.report.content import Text
from tests.builders import gap_artifacts as made
from tests.builders.forms import in_all_forms, phrases, words

GREW = {"gap/after_floors": np.array([60.0, 0.01, 0.9, 0.9, 0.8, 1.2])}
FAULT = ("gyro_bias", 1, 1e-9, "The gyroscope shows 0.01 rad/s at rest.")
RIVALS = [("torque_bias", "com_offset", 0.98, "change the thrust", "")]
LEFT = [("torque z", 14.2, "yaw", 0.82, 3.21, "feeds"), ("force x", 2.0, "", 0.0, np.nan, "neither")]
_WIDE = 80
BROKEN = made.texts("rotor 2 looks saturated")


@pytest.mark.parametrize(
    ("stage", "found"),
    [
        ("compare", made.disagreement()),
        ("compare", made.disagreement(force=False)),
        ("compare", made.disagreement(**{"gap/floors": np.linspace(1.0, 1.5, 6)})),
        ("diagnose", made.diagnosis()),
        ("diagnose", made.diagnosis("AMBIGUOUS", alternatives=RIVALS)),
        ("diagnose", made.diagnosis("UNEXPLAINED", named=({"named": 0},), unexplained=LEFT)),
        ("diagnose", made.diagnosis("NO_GAP", named=(), force=False)),
        ("extend", made.extended()),
        ("extend", made.extended(**GREW)),
        (
            "diagnose",
            made.diagnosis(
                named=({"name": "gyro_bias", "kind": "sensor"},), **made.audit([FAULT]) | {"audit/warning": BROKEN}
            ),
        ),
    ],
)
def test_every_form_says_what_the_command_says(stage, found):
    _require_in_all_forms(made.source_of(found, stage), made.blocks_of(found, stage))


def _holds(told, phrase):
    return set(words(phrase).split()) <= set(told.split())


def _require_in_all_forms(source, blocks):
    said = [phrase for block in blocks for phrase in phrases(block)]
    assert len(said) > 6
    warned = [block.text for block in blocks if isinstance(block, Text) and block.tone == "warning"]
    for form, text in in_all_forms(source, blocks).items():
        told = words(text)
        for phrase in said:
            # Warnings of a command go to standard error, and a terminal breaks long cells.
            assert words(phrase) in told or (
                form == "terminal" and (phrase in warned or (len(phrase) > _WIDE and _holds(told, phrase)))
            ), (form, phrase)
