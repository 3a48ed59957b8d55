"""Bands, curves and timelines of a validation."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, inertia_matrix, visited_cells
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.identification.data import Flights, TorqueData
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import Motion, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation.bands import Draws, cell_centres, definite_share, inertia_band
from cpfls_cli.validation.residuals import lagged_pairs, sample_numbers, sample_period, stretch_numbers, time_blocks
from cpfls_cli.validation.validate import curves
from tests.builders.flights import still_flight

RANGE = InputRange(-1.0, 1.0)
BODY = np.array([0.6, 0.8, 1.2, 0.05, 0.0, -0.03])
BEST = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
STRUCTURE = model_structure(IdentificationSettings(harmonic_order=1))


def model(visited):
    structure = model_structure(StructureSettings())
    parts = uniform_breakpoints(structure)
    return InertiaFunctions(structure, (RANGE, RANGE), parts, np.zeros(structure.parameters), BODY, visited)


def random_draws(own, size, count=60, seed=91):
    rng = np.random.default_rng(seed)
    rigid = BODY + 0.1 * rng.standard_normal((count, 6))
    return Draws(size * rng.standard_normal((count, len(own.coefficients))), rigid, rigid, 40, 1.0)


@pytest.mark.parametrize("at_once", [1_000_000, 100])
def test_share_of_draws_is_that_of_their_models(monkeypatch, at_once):
    monkeypatch.setattr("cpfls_cli.validation.bands._AT_ONCE", at_once)
    visited = np.zeros((72, 72), dtype=bool)
    visited[30:40, 30:40] = True
    own = model(visited)
    drawn = random_draws(own, 0.2)
    each = [
        np.linalg.eigvalsh(
            replace(own, coefficients=fuzzy, rigid_body=rigid).inertia(cell_centres(visited)).value
        ).min()
        > 0
        for fuzzy, rigid in zip(drawn.coefficients, drawn.rigid_body, strict=True)
    ]
    assert 0.1 < np.mean(each) < 0.9
    assert definite_share(own, drawn) == pytest.approx(np.mean(each))


def test_near_a_vertical_pitch_noise_says_nothing_of_a_body():
    """One row of cells there, at a pitch of 77.5 degrees, changes nothing; alone it leaves no share."""
    visited, near = np.zeros((2, 72, 72), dtype=bool)
    visited[30:40, 30:40] = near[:, 51] = True
    drawn = random_draws(model(visited), 0.2)
    assert definite_share(model(visited | near), drawn) == definite_share(model(visited), drawn) < 1
    assert definite_share(model(near), drawn) is None


def test_no_cell_was_visited():
    own = model(np.zeros((72, 72), dtype=bool))
    assert definite_share(own, random_draws(own, 0.05)) is None


def drawn(roll, pitch):
    """Curves of a random model over a flight whose roll and pitch lie within ranges in degrees."""
    rng = np.random.default_rng(12)
    angles = np.deg2rad([np.linspace(*ends, 2001) for ends in (roll, pitch)])
    attitude = np.column_stack([*angles, np.full(2001, 7.0)])
    still = np.zeros_like(attitude)
    training = TorqueData(0.01 * np.arange(2001), Motion(attitude, still, still), still)
    ranges, parameters = data_ranges(STRUCTURE, attitude), STRUCTURE.parameters
    partitions = uniform_breakpoints(STRUCTURE)
    model = InertiaFunctions(
        STRUCTURE, ranges, partitions, rng.standard_normal(parameters), BEST, visited_cells([attitude])
    )
    draws = Draws(
        model.coefficients + 0.1 * rng.standard_normal((30, parameters)),
        BEST + 0.01 * rng.standard_normal((30, 6)),
        BEST + 0.01 * rng.standard_normal((30, 6)),
        blocks=10,
        block_duration=1.0,
    )
    return curves(model, draws, BEST, training), model, draws


def test_whole_turns_where_the_flight_went_far():
    found, model, draws = drawn((-170, 180 + 350), (-20, 60))
    assert found.name == ("over roll", "over pitch")
    over_roll, over_pitch = np.rad2deg(found.attitude)
    np.testing.assert_allclose(over_roll[:, 0], np.linspace(-180, 180, 181), atol=1e-9)
    np.testing.assert_allclose(over_roll[:, 1:], [[20.0, 0.0]] * 181, atol=1e-9)
    np.testing.assert_allclose(over_pitch[:, 1], np.linspace(-180, 180, 181), atol=1e-9)
    assert not found.outside[:, 90].all()
    assert found.outside[1, 0]
    for curve in range(2):
        attitude = found.attitude[curve]
        np.testing.assert_allclose(found.inertia[curve], model.inertia(attitude).value)
        np.testing.assert_allclose(found.rigid_body[curve], inertia_matrix(attitude, symmetric(BEST)))
        np.testing.assert_array_equal(found.outside[curve], model.outside(attitude))
        np.testing.assert_allclose([found.low[curve], found.high[curve]], inertia_band(model, draws, attitude))


@pytest.mark.parametrize(("pitch", "ends"), [((-10, 30), (-20, 40)), ((5, 5), (3, 7)), ((-29, 30), (-43.75, 44.75))])
def test_close_up_where_it_did_not(pitch, ends):
    found, _, _ = drawn((-170, 170), pitch)
    over_roll, over_pitch = np.rad2deg(found.attitude)
    assert over_roll[[0, -1], 0] == pytest.approx((-180, 180))
    assert over_pitch[[0, -1], 1] == pytest.approx(ends)
    np.testing.assert_allclose(over_pitch[:, 0], 0.0, atol=1e-9)


def blank_flight(samples):
    return still_flight(np.zeros((samples, 3)))


@pytest.mark.parametrize(
    "data",
    [blank_flight(4000), Flights((blank_flight(2000), blank_flight(2000)))],
    ids=["one", "two, without their pause"],
)
def test_a_fortieth_of_the_flights_unless_asked_otherwise(data):
    blocks = time_blocks(data, None)
    assert blocks.duration == pytest.approx(1.0)
    np.testing.assert_array_equal(blocks.labels(data), np.arange(4000) // 100)


@pytest.mark.parametrize(("asked", "expected"), [(2.0, 20), (0.5, 80), (1e-3, 200), (1e6, 2)])
def test_blocks_of_a_duration(asked, expected):
    blocks = time_blocks(blank_flight(4000), asked)
    assert len(blocks.starts) + 1 == expected
    assert blocks.duration == pytest.approx(40.0 / expected)


def test_no_more_than_there_is_memory_for():
    assert len(time_blocks(blank_flight(4000), None, most=7).starts) == 6


@pytest.mark.parametrize(("samples", "expected"), [(400, 20), (100, 5), (30, 2), (2, 2), (1, 1)])
def test_a_short_flight_has_fewer(samples, expected):
    data = blank_flight(samples)
    label = time_blocks(data, None).labels(data)
    assert (label[0], label[-1]) == (0, expected - 1)


def test_a_selection_counts_the_blocks_that_it_is_in():
    data = blank_flight(4000)
    blocks = time_blocks(data, None)
    learned = data[np.array([5, 7, 150, 151, 3999])]
    assert blocks.number(learned.time).tolist() == [0, 0, 1, 1, 39]
    assert blocks.labels(learned).tolist() == [0, 0, 1, 1, 2]


def test_a_pause_starts_a_stretch_and_jitter_does_not():
    time = np.arange(20) * 0.01 + np.random.default_rng(53).uniform(-0.002, 0.002, 20)
    time[12:] += 0.01
    np.testing.assert_array_equal(stretch_numbers(time), np.repeat([0, 1], [12, 8]))
    np.testing.assert_array_equal(stretch_numbers(time[:1]), [0])
    assert np.isnan(sample_period(time[:1]))


def test_a_slow_flight_and_a_fast_one_are_two_stretches():
    slow, fast = 0.01 * np.arange(300), 0.002 * np.arange(2000)
    for time in (np.r_[slow, 1e4 + fast], np.r_[fast, 1e4 + slow]):
        assert stretch_numbers(time)[-1] == 1
        assert sample_numbers(time, 8)[-1] == 2298 + 8
    np.testing.assert_array_equal(lagged_pairs(sample_numbers(slow[[0, 1, 3, 4]], 8), 2), [[1], [2]])
