"""What is said of gusts: sizes, what no gust exceeds, and what is not known."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.artifacts.disturbance import DisturbanceGroup
from cpfls_cli.pages.disturbance import gust_blocks
from cpfls_cli.pages.model import answer
from cpfls_cli.playback.disturbance import FoundGusts
from cpfls_cli.report.content import Facts, Table, Text, unfolded
from cpfls_cli.report.outcome import as_json
from tests.builders import gap_artifacts as made
from tests.builders.forms import source_of_record
from tests.builders.vehicle_models import QUAD, record_of, whole

BODIES = np.array([*QUAD.inertia_kg_m2[:3], *[QUAD.mass_kg] * 3])
FOUND = FoundGusts(
    size=BODIES * [3.0, np.nan, np.nan, 0.3, np.nan, np.nan],
    low=BODIES * [2.5, 0.0, np.nan, 0.25, 0.0, 0.0],
    high=BODIES * [3.6, 0.5, np.nan, 0.4, 0.1, 0.2],
    memory=np.array([0.4, np.nan, np.nan, 1.0, np.nan, np.nan]),
    memory_low=np.array([0.2, np.nan, np.nan, 0.8, np.nan, np.nan]),
    memory_high=np.array([0.8, np.nan, np.nan, 1.3, np.nan, np.nan]),
    told_by="repeats",
    noise=np.zeros((6, 2)),
    foretold=np.full(6, 0.1),
    foretold_without=np.full((9, 6), 0.1),
)


def record(found=FOUND):
    return replace(record_of(replace(whole(), gusts=found.gusts)), disturbance=DisturbanceGroup.of(found))


def said(of):
    return " ".join(block.text for block in gust_blocks(of, 1) if isinstance(block, Text))


def test_sizes_are_told_as_accelerations_with_how_long_they_last():
    words = said(record())
    assert "Gusts: 3.0 rad/s² about roll (2.5 to 3.6), lasting 0.40 s (0.20 to 0.80); 0.30 m/s² along x" in words
    assert "No gusts above 0.50 rad/s² about pitch, 0.10 m/s² along y and 0.20 m/s² along z." in words
    assert "Gusts about yaw are not known" in words
    assert "--gusts" in words
    (table,) = [
        block
        for block in unfolded(answer(source_of_record(record())))
        if getattr(block, "name", "") == "vehicle-gusts-1"
    ]
    assert isinstance(table, Table)
    assert len(table.cells) == 6


def test_without_instruments_there_is_a_bound():
    bound = replace(FOUND, size=np.full(6, np.nan), memory=np.full(6, np.nan), told_by="none")
    assert bound.gusts is None
    words = said(record(bound))
    assert words.startswith("No gusts above 3.6 rad/s² about roll")
    assert "nothing separates gusts from what it lacks" in words
    assert "--gusts" not in words


def test_where_flights_show_the_loop_alone_sizes_are_not_known():
    shown = record_of(whole())
    assert said(shown) == ""
    assert "their sizes are not known" in said(replace(shown, loop=replace(shown.loop, shown=True)))


def test_a_file_without_gusts_is_one_of_still_air():
    assert record_of(whole()).summary["gusts"] is None
    assert record_of(whole()).summary["disturbance"] is None


def test_machines_read_sizes_and_accelerations():
    axes = as_json(record().summary["disturbance"]["axes"])
    assert list(axes) == ["roll", "pitch", "yaw", "x", "y", "z"]
    assert axes["roll"]["size"] == pytest.approx(3.0 * BODIES[0])
    assert axes["roll"]["acceleration"]["high"] == pytest.approx(3.6)
    assert axes["roll"]["memory_low_s"] == 0.2
    assert axes["pitch"]["size"] is None
    assert axes["pitch"]["low"] == 0
    assert axes["yaw"]["high"] is None
    assert record().summary["gusts"]["force_n"] == pytest.approx([0.3 * QUAD.mass_kg, 0.0, 0.0])


def test_gusts_stand_on_a_small_screen_beside_however_many_effects():
    air = DisturbanceGroup.of(FOUND, np.isfinite(FOUND.size))
    blocks = made.blocks_of(replace(made.diagnosis(named=({},) * 3), air=air), "diagnose")
    rows = [row for block in blocks if isinstance(block, Facts) for row in block.rows]
    (words,) = [words for name, words in rows if name == "Gusts"]
    assert words.startswith("What is left is gusts, ")
