"""What is said of gusts: sizes, what no gust exceeds, and what is not known."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import page
from cpfls_cli.playback.disturbance import FoundGusts
from cpfls_cli.report.content import Facts, Table, Text, unfolded
from cpfls_cli.result import plain
from cpfls_cli.stages.vehicle import vehicle
from tests.builders import gap_artifacts as made
from tests.builders.vehicle_models import QUAD, source_of_vehicle, vehicle_of, whole

BODIES = np.array([*QUAD.inertia_kg_m2[:3], *[QUAD.mass_kg] * 3])
FOUND = FoundGusts(
    size=BODIES * [3.0, np.nan, np.nan, 0.3, np.nan, np.nan],
    low=BODIES * [2.5, 0.0, np.nan, 0.25, 0.0, 0.0],
    high=BODIES * [3.6, 0.5, np.nan, 0.4, 0.1, 0.2],
    memory=np.array([0.4, np.nan, np.nan, 1.0, np.nan, np.nan]),
    memory_low=np.array([0.2, np.nan, np.nan, 0.8, np.nan, np.nan]),
    memory_high=np.array([0.8, np.nan, np.nan, 1.3, np.nan, np.nan]),
    instrument_kind="repeats",
    noise=np.zeros((6, 2)),
    predicted=np.full(6, 0.1),
    predicted_without=np.full((9, 6), 0.1),
)


def found_in(found=FOUND):
    return vehicle_of(replace(whole(), gusts=found.gusts), disturbance=found)


def blocks_of(of):
    return list(unfolded(page.blocks(vehicle.text(of, about=source_of_vehicle(of)))))


def said(of):
    texts = [block.text for block in blocks_of(of) if isinstance(block, Text)]
    return " ".join(text for text in texts if text.startswith(("Gusts:", "No gusts")))


def test_sizes_are_told_as_accelerations_with_how_long_they_last():
    words = said(found_in())
    assert "Gusts: 3.0 rad/s² about roll (2.5 to 3.6), lasting 0.40 s (0.20 to 0.80); 0.30 m/s² along x" in words
    assert "No gusts above 0.50 rad/s² about pitch, 0.10 m/s² along y and 0.20 m/s² along z." in words
    assert "Gusts about yaw are not known" in words
    assert "--gusts" in words
    (table,) = [block for block in blocks_of(found_in()) if isinstance(block, Table) and block.header[0] == "Gusts"]
    assert len(table.cells) == 6


def test_without_instruments_there_is_a_bound():
    bound = replace(FOUND, size=np.full(6, np.nan), memory=np.full(6, np.nan), instrument_kind="none")
    assert bound.gusts is None
    words = said(found_in(bound))
    assert words.startswith("No gusts above 3.6 rad/s² about roll")
    assert "nothing separates gusts from what it lacks" in words
    assert "--gusts" not in words


def test_where_flights_show_the_loop_alone_sizes_are_not_known():
    shown = vehicle_of(whole())
    assert said(shown) == ""
    assert "their sizes are not known" in said(replace(shown, loop=shown.loop._replace(explained=np.full(3, 0.5))))


def test_machines_read_sizes():
    told = plain(found_in())
    assert told["disturbance"]["name"] == ["roll", "pitch", "yaw", "x", "y", "z"]
    assert told["disturbance"]["size"][0] == pytest.approx(3.0 * BODIES[0])
    assert told["disturbance"]["size"][1] is None
    assert told["model"]["gusts"]["size"][3] == pytest.approx(0.3 * QUAD.mass_kg)
    assert plain(vehicle_of(whole()))["disturbance"] is None


def test_gusts_stand_on_a_small_screen_beside_however_many_effects():
    air = replace(FOUND, alone=np.isfinite(FOUND.size))
    blocks = made.blocks_of(replace(made.diagnosis(named=({},) * 3), air=air), "diagnose")
    rows = [row for block in blocks if isinstance(block, Facts) for row in block.rows]
    (words,) = [words for name, words in rows if name == "Gusts"]
    assert words.startswith("The residual is gusts, ")
