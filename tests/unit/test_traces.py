"""Signals over time in a page."""

import base64
import json
import re
import zlib
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.trace import thinned, track
from cpfls_cli.traces import traces


def event(time, text="x", until=np.nan, severity="note"):
    return SimpleNamespace(time_s=time, until_s=until, text=text, severity=severity)


def data_of(shown):
    return json.loads(re.search(r'id="traces-data">(.*?)</script>', shown)[1])


def unpacked(text, kind):
    """Whole numbers as the page reads them."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return planes.reshape(np.dtype(kind).itemsize, -1).T.copy().view(kind).ravel()


def decoded(shown):
    """Time and values of each track, as the page reads them."""
    data = data_of(shown)
    for own in (own for panel in data["panels"] for own in panel["tracks"]):
        time = data["span"][0] + data["tick"] * np.cumsum(unpacked(own["time"], "<u4").astype(np.int64))
        steps = unpacked(own["values"], "<u2").reshape(len(own["labels"]), -1)
        levels = np.cumsum(steps, axis=1, dtype=np.uint64) % 65536
        low, step = np.array(own["scales"]).T[:, :, None]
        yield own, time, np.where(levels > 0, low + (levels - 1.0) * step, np.nan)


@pytest.mark.parametrize("most", [10, 100, 998, 5000])
def test_thinned_signals_keep_each_peak_and_each_gap(most):
    values = np.random.default_rng(1).standard_normal((2000, 2)).astype(np.float32)
    values[777, 0], values[1999, 1] = 50.0, -50.0
    values[1200:1300] = np.nan
    time, kept = thinned(np.arange(2000.0), values, most)
    assert len(time) == len(kept) <= max(most, 2000 if most > 2000 else 0)
    assert (np.diff(time) >= 0).all()
    assert (np.nanmax(kept[:, 0]), np.nanmin(kept[:, 1])) == (50.0, -50.0)
    assert np.isnan(kept).any()
    assert abs(time[int(np.nanargmax(kept[:, 0]))] - 777) <= 2 * 2000 / min(most, 2000) + 1


def test_a_track_has_a_gap_where_the_log_has_one_and_no_signal_of_nothing():
    time = np.r_[np.arange(100), 300 + np.arange(100)] * 0.01
    own = track(("a", "b"), time, np.column_stack([time, np.full(200, np.nan)]))
    assert (own.labels, len(own.time)) == (("a",), 201)
    assert np.isnan(own.values[100, 0])
    assert own.time[99] < own.time[100] < own.time[101]


def test_the_page_reads_what_was_given():
    rng = np.random.default_rng(2)
    time = 5.0 + np.cumsum(0.001 + 0.0003 * rng.random(3000))
    values = np.cumsum(rng.standard_normal((3000, 3)), axis=0)
    values[500:600, 1] = np.nan
    slow = track(("V",), time[::50], np.full(60, 11.1))
    shown = traces({"rate, deg/s": [track(("roll", "pitch", "yaw"), time, values)], "battery, V": [slow], "none": []})
    (own, read_time, read), (_, _, volts) = decoded(shown)
    assert own["labels"] == ["roll", "pitch", "yaw"]
    assert np.abs(read_time - time).max() < 1.01e-4
    assert np.array_equal(np.isnan(read.T), np.isnan(values))
    # Far below the changes from sample to sample.
    assert np.nanmax(np.abs(read.T - values)) < 0.03
    assert np.allclose(volts, 11.1, atol=1e-5)
    assert [panel["title"] for panel in data_of(shown)["panels"]] == ["rate, deg/s", "battery, V"]


def test_time_of_any_length_and_values_of_any_size_are_kept():
    time = np.array([0.0, 1e7, 2e7])
    (_, read, values), *_ = decoded(traces({"a, u": [track(("a",), time, np.array([1.0, 1e300, 2.0]))]}))
    assert read == pytest.approx(time, abs=0.01)
    assert values[0] == pytest.approx([1.0, np.nan, 2.0], nan_ok=True)


def test_a_long_log_makes_no_large_page():
    rng = np.random.default_rng(3)
    time = np.arange(130_000) * 0.001
    noise = rng.standard_normal((130_000, 12)).astype(np.float32)
    shown = traces({"noise": [track(tuple("abcdefghijkl"), time, noise)]})
    ((_, _, read),) = decoded(shown)
    assert read.size <= 1_500_000
    assert len(shown) < 3e6
    assert np.allclose(np.nanmax(read, axis=1), noise.max(axis=0), atol=0.1)


def test_events_are_listed_without_scripts_and_no_text_is_obeyed():
    own = track(("a</script>",), np.arange(10.0), np.arange(10.0))
    found = [
        event(2.5, "<b>\u202e</script>"),
        event(4.0, "limit", until=6.0, severity="danger"),
        event(5.0, severity="?"),
    ]
    shown = traces({"p</script>": [own]}, found)
    assert '<li class="note" data-from="2.500" data-to="2.500">2.5 s &lt;b&gt;\\u202e&lt;/script&gt;</li>' in shown
    assert '<li class="danger" data-from="4.000" data-to="6.000">4.0 s limit</li>' in shown
    assert shown.count('class="note"') == 2
    assert shown.count("</script>") == shown.count("<script") == 3
    assert data_of(shown)["panels"][0]["title"] == "p</script>"


@pytest.mark.usefixtures("drawn")
def test_the_still_picture_and_the_licence_are_there():
    shown = traces({"rate": [track(("a",), np.arange(10.0), np.arange(10.0), dashed=True)]}, [event(3.0)])
    still = shown[shown.index('class="still plot"') :]
    assert 'role="img" aria-label="Signals over the whole log"' in still
    # The signal, its key and the moment of the event.
    assert still.count("stroke-dasharray") == 3
    assert "Copyright (c) 2022 Leon Sorokin" in shown
    assert "Permission is hereby granted" in shown
    assert not re.search(r"(src|href)=\"?https?:", shown)


def test_without_signals_there_is_nothing():
    assert traces({"rate": [track(("a",), np.arange(10.0), np.full(10, np.nan))]}, [event(3.0)]) == ""
