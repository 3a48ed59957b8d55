"""Sentences of the gap workflow: what comes first, digits that tell, and nothing about what no flight shows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.commands.extend import require_named
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.extended import worse_axes
from cpfls_cli.gap.naming.results import Alternative, Diagnosis, Estimate, GapSize, GapVerdict, NamedEffect, Unexplained
from cpfls_cli.gap.replay import Replayed
from cpfls_cli.pages.diagnosis_words import diagnosis_lines, effect_line, headline
from cpfls_cli.pages.disagreement_words import replay_lines

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
GAP = GapSize(np.ones(6), np.ones(6))
NO_FORCE = GapSize(np.array([1.0, 1, 1, np.nan, np.nan, np.nan]), np.array([1.0, 1, 1, np.nan, np.nan, np.nan]))
DIAGNOSIS = Diagnosis(
    GapVerdict.NAMED, (OFFSET,), (), (), (), (), {}, 1.0, GAP, GAP, np.ones(6), (("linear_damping", 0.99),), ()
)


HELD = Replayed(np.array([0.1]), np.ones((1, 3)), np.ones((1, 3)))
SHOWN = SimpleNamespace(before=HELD, after=HELD, held=HELD)
AUDIT = SimpleNamespace(named=(), findings=(), notes=(), untested={})


def lines(**changed):
    return diagnosis_lines(SimpleNamespace(diagnosis=replace(DIAGNOSIS, **changed), audit=AUDIT), SHOWN, "by flight")


def test_ends_of_an_interval_can_be_told_apart_and_rounding_makes_no_certainty():
    said = effect_line(OFFSET)
    assert (
        said
        == "com_offset: Off centre. c_x = 0.01000000 [0.00999950, 0.01000120] m (p < 1e-6, more than 99 % of the gap)"
    )
    assert "less than 1 % of" in effect_line(replace(OFFSET, share=-0.001))


def test_what_hangs_on_another_flight_says_so_first():
    rival = Alternative("torque_bias", "com_offset", 0.99, "change the thrust")
    ambiguous = list(headline(replace(DIAGNOSIS, verdict=GapVerdict.AMBIGUOUS, alternatives=(rival,))))
    assert ambiguous[1] == "could be torque_bias instead of com_offset; to tell: change the thrust"
    named = list(headline(replace(DIAGNOSIS, alternatives=(rival,))))
    assert named[1].startswith("com_offset: ")
    assert named[2] == ambiguous[1]


def test_two_names_are_explained_where_forces_are_known():
    assert any(line.startswith("torque alone would say linear_damping (99 % of the gap)") for line in lines())
    assert not any(line.startswith("torque alone") for line in lines(before=NO_FORCE, after=NO_FORCE))
    fault = replace(OFFSET, name="gyro_bias", candidate=None)
    assert not any(line.startswith("torque alone") for line in lines(effects=(fault,)))


@pytest.mark.parametrize(
    ("left", "said"),
    [
        (
            Unexplained("torque z", 3.04, "speed", 0.4, None, "drains"),
            "unexplained: torque z, 3 floors, depends on speed most (40 % of it); it drains energy from the rotation",
        ),
        (
            Unexplained("torque x", 2.2, None, 0.6, 4.013, "feeds"),
            "unexplained: torque x, 2.2 floors, rings at 4.01 Hz (60 % of it); it feeds energy into the rotation",
        ),
        (
            Unexplained("force z", 2.2, None, 0.0, None, "neither"),
            "unexplained: force z, 2.2 floors, depends on no one signal",
        ),
    ],
)
def test_what_is_left_has_an_axis_a_cause_and_a_way_of_energy(left, said):
    assert said in lines(verdict=GapVerdict.UNEXPLAINED, unexplained=(left,))


def test_flights_without_rates_are_not_simulated():
    still = replace(HELD, rate=np.zeros((1, 3)))
    assert list(replay_lines("simulated", HELD, still)) == []
    assert len(list(replay_lines("simulated", HELD, HELD))) == 1


@pytest.mark.parametrize("verdict", [GapVerdict.UNEXPLAINED, GapVerdict.NO_GAP, GapVerdict.NOT_EXCITED])
def test_only_names_are_added(verdict):
    with pytest.raises(ComputationError, match=f"the diagnosis is {verdict} and names no effect"):
        require_named(verdict, [OFFSET])
    with pytest.raises(ComputationError, match="names no effect"):
        require_named(GapVerdict.NAMED, [])
    for good in (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS):
        require_named(good, [OFFSET])


def test_axes_that_get_worse():
    before = np.array([2.0, 1.4, 10.0, 3.0, np.nan, 1.0])
    assert worse_axes(before, 1.3 * before) == [0, 2]
    assert worse_axes(before, 1.1 * before) == []
