"""The section about control with a model: what it says of better and worse ones."""

import numpy as np
import pytest

from cpfls_cli.artifacts.flight import FlightRecord, TrackingGroup
from cpfls_cli.artifacts.spec import Header, InputFile
from cpfls_cli.config.study import ReportSettings, Study, resolved
from cpfls_cli.pages.page import sections_of
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Cell, Plot, Table, Text, unfolded
from cpfls_cli.report.numbers import number
from cpfls_cli.vehicle.settings import VehicleSettings

pytestmark = pytest.mark.usefixtures("undrawn")
SETTINGS = {"plant": "vehicle", "natural_frequency_hz": [1.2, 1.2, 0.5], "damping": 1.0, "torque_max_n_m": None}
NAMES = ("model", "rigid-body", "pd", "vehicle")


def page(flight, settings=SETTINGS):
    inputs = {role: InputFile(f"{role}.h5", "0" * 64, "cpfls/x") for role in ("model", "trajectory")}
    config = resolved(Study()) | {"simulation": {"mode": "computed-torque", "computed_torque": settings}}
    record = flight.with_header(Header("0", 1, "", inputs))
    source = Source("tracked.h5", "1" * 64, record, config, VehicleSettings(), 0)
    made = sections_of(Sources([source], VehicleSettings(), ReportSettings()))
    return next((section for section in made if section.name == "tracking"), None)


def sections(shares, settings=SETTINGS, **changed):
    """A page about errors of so many degrees, each the same all the time and on all axes."""
    time = np.arange(301) / 100
    size = np.radians(np.array(shares, dtype=float))
    by_axis = np.tile(size[:, None], (1, 3))
    comparison = {
        "controller": NAMES,
        "time": time,
        "error": np.tile(size[:, None, None], (1, len(time), 3)),
        "settled_from": 1.0,
        "rms": by_axis,
        "settled_rms": by_axis,
        "max_error": by_axis,
        "settled_max": by_axis,
        "torque_rms": 0.5 + 0 * by_axis,
        "clipped": np.array([0.25, 0.0, 0.0, 0.0]),
        "lost_at": np.where(np.isfinite(size), np.nan, 2.0),
        "control_rate": 100.0,
        "outside": np.zeros(len(time), dtype=bool),
        "not_positive_definite": 0,
        **changed,
    }
    rotors = np.ones((len(time), 4))
    return page(FlightRecord(time=time, rotor_speed=rotors, tracking=TrackingGroup(**comparison)), settings)


def texts(section):
    return {block.text: block.tone for block in section.blocks if isinstance(block, Text)}


def test_a_flight_without_controllers_has_no_section():
    assert page(FlightRecord(time=np.zeros(2))) is None


@pytest.mark.parametrize(
    ("model", "tones"),
    [(0.5, ["good", "good"]), (1.005, ["good", "good"]), (2.0, ["note", "good"]), (9.0, ["note", "warning"])],
)
def test_the_model_is_praised_only_where_it_is_no_worse(model, tones):
    said = {text: tone for text, tone in texts(sections([model, 1.0, 8.0, 0.4])).items() if "times that" in text}
    assert list(said.values()) == tones
    assert f"is {', '.join([number(model, 3)] * 3)} times that of the rigid body" in next(iter(said))


def test_the_table_holds_degrees_by_controller():
    table, others = (block for block in unfolded(sections([0.5, 1.0, 8.0, 0.4]).blocks) if isinstance(block, Table))
    assert [row[0] for row in table.rows] == ["identified model", "rigid body", "PD alone", "exact vehicle"]
    assert table.rows[2][1:] == others.rows[2][1:4] == ["8.00"] * 3
    assert "clipped" not in table.caption


def test_a_lost_vehicle_is_told_in_its_row():
    section = sections([np.nan, 1.0, 8.0, 0.4])
    (table,) = (block for block in section.blocks if isinstance(block, Table))
    assert table.rows[0][1] == Cell("lost at 2.00 s", "warning")
    assert len(table.rows[0]) == len(table.header)
    ends = "the flight ends after 301 samples, where the controller with the model lost the vehicle"
    assert texts(section)[ends] == "warning"
    assert not any("times that" in text for text in texts(section))


def test_clipping_extrapolation_and_impossible_inertia_are_told():
    limited = {**SETTINGS, "torque_max_n_m": [1.0, 1.0, 1.0]}
    outside = np.arange(301) < 7
    section = sections([0.5, 1.0, 8.0, 0.4], limited, outside=outside, not_positive_definite=3)
    (table,) = (block for block in section.blocks if isinstance(block, Table))
    assert "Commands clipped: identified model 25.0 %, rigid body 0 %" in table.caption
    assert [text for text, tone in texts(section).items() if tone == "warning"] == [
        "7 of 301 samples lie outside the attitudes that training visited: do not trust it there, the model "
        "extrapolates",
        "D(q) is not positive definite at 3 of 301 samples: no body moves like that",
    ]


@pytest.mark.usefixtures("data_of_figures")
def test_the_figure_draws_each_controller_at_its_error():
    (figure,) = (block for block in sections([0.5, 1.0, 8.0, np.nan]).blocks if isinstance(block, Plot))
    curves = {
        series.label: series for series in figure.picture.panels[0].series if series.form == "line" and len(series.x)
    }
    assert list(curves) == ["identified model", "rigid body", "PD alone"]
    for curve, size in zip(curves.values(), (0.5, 1.0, 8.0), strict=True):
        np.testing.assert_allclose(curve.y, size)
