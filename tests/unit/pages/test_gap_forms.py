"""What the commands of the gap workflow say stands in every form of the report, in the same words and numbers."""

import numpy as np
import pytest

from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.pages import diagnosis, disagreement, model
from cpfls_cli.report.content import Text
from tests.builders import gap_artifacts as made
from tests.builders.forms import in_all_forms, phrases, source_of_record, words

GREW = {"gap/after_floors": np.array([60.0, 0.01, 0.9, 0.9, 0.8, 1.2])}
FAULT = ("gyro_bias", 1, 1e-9, "The gyroscope shows 0.01 rad/s at rest.")
RIVALS = [("torque_bias", "com_offset", 0.98, "change the thrust", "")]
LEFT = [("torque z", 14.2, "yaw", 0.82, 3.21, "feeds"), ("force x", 2.0, "", 0.0, np.nan, "neither")]
BROKEN = made.texts("rotor 2 looks saturated")


@pytest.mark.parametrize(
    ("kind", "page", "artifact"),
    [
        (DisagreementRecord, disagreement, made.disagreement()),
        (DisagreementRecord, disagreement, made.disagreement(force=False)),
        (DisagreementRecord, disagreement, made.disagreement(**{"gap/floors": np.linspace(1.0, 1.5, 6)})),
        (DiagnosisRecord, diagnosis, made.diagnosis(alone=[("torque_bias", 0.9)])),
        (DiagnosisRecord, diagnosis, made.diagnosis("AMBIGUOUS", alternatives=RIVALS)),
        (DiagnosisRecord, diagnosis, made.diagnosis("UNEXPLAINED", named=({"named": 0},), unexplained=LEFT)),
        (DiagnosisRecord, diagnosis, made.diagnosis("NO_GAP", named=(), force=False)),
        (
            DiagnosisRecord,
            diagnosis,
            made.diagnosis(
                named=({"name": "gyro_bias", "kind": "sensor"},), **made.audit([FAULT]) | {"audit/warning": BROKEN}
            ),
        ),
        (ExtendedRecord, model, made.extended()),
        (ExtendedRecord, model, made.extended(**GREW)),
    ],
)
def test_every_form_says_what_the_command_says(kind, page, artifact):
    record = kind.of_data(artifact.header, artifact.data)
    source = source_of_record(record)
    blocks = list(page.answer(source))
    said = [phrase for block in blocks for phrase in phrases(block)]
    assert len(said) > 6
    warned = [block.text for block in blocks if isinstance(block, Text) and block.tone == "warning"]
    for form, text in in_all_forms(source, blocks).items():
        told = words(text)
        for phrase in said:
            # Warnings of a command go to standard error.
            assert words(phrase) in told or (form == "terminal" and phrase in warned), (form, phrase)
