"""Effects in words: digits that tell, and nothing rounded into certainty."""

from dataclasses import replace

import numpy as np

from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.results import Estimate, NamedEffect
from cpfls_cli.pages.effects import closest_sentence, coefficients_table, effect_sentence, effect_title
from tests.builders import gap_artifacts as made

OFFSET = NamedEffect(
    "com_offset",
    Candidate(CATALOGUE["com_offset"], {}),
    np.array([0.01]),
    (Estimate("c_x", "m", 0.0100000015, 0.0099995, 0.0100012, (-0.1, 0.1)),),
    1e-9,
    0.998,
    1.0,
    "Off centre.",
)


def test_every_effect_has_a_title():
    assert all(effect_title(name) == entry.title for name, entry in CATALOGUE.items())
    assert effect_title("of_another_version") == "of another version"


def test_ends_of_an_interval_can_be_told_apart_and_rounding_makes_no_certainty():
    assert effect_sentence(OFFSET) == (
        "Offset of the centre of mass (com_offset): Off centre. c_x = 0.01000000 [0.00999950, 0.01000120] m "
        "(p < 10⁻⁶, more than 99 % of the gap)."
    )
    assert "less than 1 % of" in effect_sentence(replace(OFFSET, share=-0.001))
    assert "(p = 0.012, " in effect_sentence(replace(OFFSET, p_value=0.0123))
    assert closest_sentence(OFFSET).startswith("The closest was offset of the centre of mass, and that is not it: ")


def test_an_effect_stands_once_beside_its_coefficients():
    artifact = made.diagnosis(named=({}, {"name": "of_another_version"}))
    record = DiagnosisRecord.of_data(artifact.header, artifact.data)
    rows = coefficients_table("coefficients", record.effects).rows
    assert [row[0] for row in rows] == ["com_offset", "of_another_version"]
    assert [effect.name for effect in record.effects.named] == ["com_offset", "of_another_version"]
