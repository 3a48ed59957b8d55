"""Signals over time with their events, to be zoomed: uPlot in the page, and a still picture where no script runs."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import escape

from cpfls_cli.arrays import Array
from cpfls_cli.errors import visible
from cpfls_cli.page import TEMPLATES
from cpfls_cli.report.canvas import BASELINE, Drawn, Figure, legend_above, stacked, style_of
from cpfls_cli.trace import Track, thinned

if TYPE_CHECKING:
    from cpfls_cli.look.timeline import Event

MOST_VALUES = 1_500_000
"""Of all signals of a page, so that it stays below some megabytes."""
_TICK_S, _MOST_TICKS = 1e-4, 2**32 - 1
"""Time is kept to so much, in so many steps at most."""
_LEVELS = 65535
"""Values are kept to so many steps of their range; 0 is none."""
_OF_NOISE = 16.0
"""Steps in the usual change from sample to sample."""
_STILL = 1200
"""Samples of a signal in the picture."""
_WIDE, _PANEL = 10.0, 1.5
"""Inches of the picture, and of a panel in it."""
_SEVERITIES = ("note", "warning", "danger")


def traces(panels: Mapping[str, Sequence[Track]], events: Sequence[Event] = ()) -> str:
    """Show signals in panels over one axis of time, with a marker for each event.

    Parameters
    ----------
    panels : mapping of str to sequence of Track
        By title, which ends in the unit: ``body rate, deg/s``.

    Returns
    -------
    str
        HTML, with scripts and styles of its own; one such part is on a page. Empty where there is no signal.
    """
    held = {title: [each for each in tracks if each.values.size] for title, tracks in panels.items()}
    shown = {title: tracks for title, tracks in held.items() if tracks}
    every = [each for tracks in shown.values() for each in tracks]
    if not every:
        return ""
    ends = min(float(each.time[0]) for each in every), max(float(each.time[-1]) for each in every)
    tick = max(_TICK_S, (ends[1] - ends[0]) / _MOST_TICKS)
    share = min(1.0, MOST_VALUES / sum(each.values.size for each in every))
    data = {
        "span": ends,
        "tick": tick,
        "panels": [
            {"title": title, "tracks": [_packed(each, share, ends[0], tick) for each in tracks]}
            for title, tracks in shown.items()
        ],
    }
    # No text of it ends the script that it is in.
    written = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    vendor = {name: (TEMPLATES / "vendor" / name).read_text(encoding="utf-8") for name in _VENDOR}
    licence, style, script = vendor.values()
    still = Drawn(
        "Signals over the whole log", 0.4 + _PANEL * len(shown), partial(_still, shown, ends), lambda _: True, _WIDE
    )
    return (
        f'<div class="traces"><ol class="events" aria-label="Events">{"".join(map(_event, events))}</ol>'
        f'<div class="moving"></div><div class="still plot">{still(events)}</div></div>'
        f"<style>{style}</style><script>/*! uPlot 1.6.32 (https://github.com/leeoniya/uPlot)\n{licence}*/\n{script}</script>"
        f'<script type="application/json" id="traces-data">{written}</script>'
        f"<script>{(TEMPLATES / 'traces.js').read_text(encoding='utf-8')}</script>"
    )


_VENDOR = ("uPlot.LICENSE.txt", "uPlot.min.css", "uPlot.iife.min.js")


def _packed(own: Track, share: float, begin: float, tick: float) -> dict[str, Any]:
    """Pack a track: differences of whole numbers, compressed, which a page decodes."""
    time, values = (
        thinned(own.time, own.values, max(2, int(share * len(own.time)))) if share < 1 else (own.time, own.values)
    )
    scales = [_scale(column[np.isfinite(column)]) for column in values.T.astype(float)]
    low, step = np.array(scales).T
    levels = np.nan_to_num(1 + np.round((values - low) / step), nan=0.0, posinf=0.0, neginf=0.0).astype(np.uint16)
    ticks = np.round((time - begin) / tick).astype(np.uint32)
    return {
        "labels": [visible(each) for each in own.labels],
        "dashed": own.dashed,
        "scales": scales,
        "time": _deflated(np.diff(ticks, prepend=np.uint32(0))),
        "values": _deflated(np.diff(levels, axis=0, prepend=np.zeros((1, levels.shape[1]), np.uint16)).T.ravel()),
    }


def _scale(values: Array) -> tuple[float, float]:
    """Choose the lowest value and the step of whole numbers: far below the noise, which does not compress."""
    if not len(values) or values.min() == values.max():
        return (float(values[0]) if len(values) else 0.0), 1.0
    noise = float(np.median(np.abs(np.diff(values))))
    return float(values.min()), max(float(np.ptp(values)) / (_LEVELS - 1), noise / _OF_NOISE)


def _deflated(whole: np.ndarray[Any, Any]) -> str:
    """Compress whole numbers, all their first bytes first, as text."""
    planes = whole.astype(whole.dtype.newbyteorder("<")).view(np.uint8).reshape(len(whole), -1).T
    return base64.b64encode(zlib.compress(planes.tobytes(), 6)).decode()


def _event(own: Event) -> str:
    until = own.until_s if np.isfinite(own.until_s) else own.time_s
    severity = own.severity if own.severity in _SEVERITIES else _SEVERITIES[0]
    words = escape(visible(own.text))
    return f'<li class="{severity}" data-from="{own.time_s:.3f}" data-to="{until:.3f}">{own.time_s:.1f} s {words}</li>'


def _still(
    panels: Mapping[str, Sequence[Track]], ends: tuple[float, float], events: Sequence[Event], figure: Figure
) -> None:
    """Draw all panels for print and for who runs no scripts."""
    rows = stacked(figure, len(panels))
    for axes, (title, tracks) in zip(rows, panels.items(), strict=True):
        for own in tracks:
            time, values = thinned(own.time, own.values, _STILL)
            for channel, label in enumerate(own.labels):
                look = {"color": style_of(channel)["color"], "linestyle": "--" if own.dashed else "-"}
                axes.plot(time, values[:, channel], label=label, linewidth=0.8, **look)
        for event in events:
            axes.axvline(event.time_s, **BASELINE)
        axes.set_xlim(*ends)
        axes.set_ylabel(title)
        legend_above(axes, 8)
    rows[-1].set_xlabel("s")
