"""The noise floor of each channel, from the residual at frequencies above the motion."""

from functools import lru_cache

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.channels import known_up_to
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.settings import ERRORS
from cpfls_cli.weak_form.windows import Windows
from cpfls_cli.weak_form.windows import windows as make_windows

# Four times as many as the spectra of a fit have numbers; windows twice as long resolve them.
_FREQUENCIES = 16
_LONGER = 2
# In reciprocals of a window: from near the first zero of its spectrum, at 3, it passes nothing of slow motion.
_LOWEST_PER_WINDOW = 2.8
_HIGHEST_OF_RATE = 0.4  # Of the sampling rate: above, filters against aliasing bend a spectrum.
# Share of a cut-off up to which even gentle filters pass nearly all, and the band that a fit needs.
_PASSED = 0.6
_BAND = 1.5
CORRELATIONS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95)  # From sample to sample; each halves the band of the one before about.
_PADDED = 8  # Frequencies for each that a window resolves, so that a sum over them is an integral.
NEGLIGIBLE = 0.003
"""Share of the torque or force below which nobody could use a correction; sampling alone leaves about as much."""
_QUIET_AXIS = 0.3
"""Torque of the most active axis that counts on every axis: what is negligible about one is so about the others."""


def noise_floor(residual: Columns, windows: Windows, cut_off: Array | None = None) -> Array:
    """Estimate the standard deviation of the window averages that noise causes, shape (6,), N m and N.

    The power of the residual is taken at frequencies above the motion. Spectra that noise can have are fitted to it:
    flat ones, as of rotors and angles; growing with the square, as of a gyroscope, whose derivative is taken; and both
    of noise that is correlated from sample to sample. The fit is read off at the frequencies that the windows average
    over. Longer windows resolve frequencies better, so that the fit can start lower; the median over the windows
    keeps bursts of motion out. Where a log was low-passed, noise is looked for below its cut-off only: above
    it the filter has removed the noise as well.

    `residual`: of the model, shape (time, 6).
    `cut_off`, shape (6,), Hz: of the filter that each channel went through before it was logged, infinite for none.
    """
    limit = np.full(6, np.inf) if cut_off is None else np.asarray(cut_off)
    floor = np.empty(6)
    for edge in np.unique(limit):
        channels = np.flatnonzero(limit == edge)
        floor[channels] = _below(residual, windows, float(edge))[channels]
    return floor


def negligible(power: Array) -> Array:
    """Compute the size of a gap, shape (6,), N m and N, below which nobody could use a correction.

    `power`: mean squares of torque and force of the motion, shape (6,), (N m)^2 and N^2, body axes; known of all.
    """
    torque, force = np.sqrt(power[:3]), np.sqrt(np.mean(power[3:]))
    return NEGLIGIBLE * np.array([*np.maximum(torque, _QUIET_AXIS * torque.max()), *[force] * 3])


def channel_cut_offs(signals: Signals, euler: bool) -> Array:
    """Find the lowest cut-off among the signals that each channel of the balance is made of.

    `euler`: whether the inertial torque takes the attitude.
    Result: shape (6,), Hz; infinite where nothing was filtered.
    """
    span = signals.rotor_span_s
    found = known_up_to(signals) | ({"rotor_speed": 0.5 / span} if span else {})
    force = next(
        (name for name in ("specific_force", "acceleration", "velocity") if getattr(signals, name) is not None), ""
    )
    torque = {"body_rate", "rotor_speed", *(["attitude"] if euler else [])}
    edges = [
        min((edge for name, edge in found.items() if name in used), default=np.inf)
        for used in (torque, {force, "rotor_speed", *(["attitude"] if force != "specific_force" else [])})
    ]
    return np.repeat(edges, 3)


def _below(residual: Columns, windows: Windows, cut_off: float) -> Array:
    """Estimate the floor of all channels from what lies between the motion and a cut-off.

    A flat and a rising spectrum are fitted, white unless coloured ones fit clearly better, and evaluated for a window.
    """
    from scipy.optimize import nnls

    length = len(windows.weight) * windows.period
    highest = min(_HIGHEST_OF_RATE / windows.period, _PASSED * cut_off)
    wanted = max(_LONGER * length, _BAND * _LOWEST_PER_WINDOW / highest)
    fits = len(residual.direct) >= 4 * wanted / windows.period
    longer = make_windows(windows.period, wanted, 0.5) if fits else windows
    lowest = _LOWEST_PER_WINDOW / (len(longer.weight) * longer.period)
    frequencies = np.linspace(lowest, max(highest, _BAND * lowest), _FREQUENCIES)
    through = longer.modulated(frequencies)
    rows = through.balance(residual.direct, residual.momentum)
    # The median, which does not see lines; that of the power of noise is ln 2 of its mean.
    power = np.median(np.abs(rows) ** 2, axis=0) / np.log(2) / (longer.weight**2).sum()
    terms = np.array([_terms(longer.weight.tobytes(), longer.period, frequency) for frequency in frequencies])
    window_terms = _terms(windows.weight.tobytes(), windows.period, 0.0) * (windows.weight**2).sum()
    floor = np.zeros(6)
    for channel, own in enumerate(power):
        if own.min() > 0:
            # Dividing by the power makes relative errors of equal weight.
            relative = terms / own[:, None]
            flat, rising = np.unravel_index(_best_pair(relative), (len(CORRELATIONS),) * 2)
            pair = [2 * flat, 2 * rising + 1]
            floor[channel] = np.sqrt(nnls(relative[:, pair], np.ones(len(own)))[0] @ window_terms[pair])
    return floor


@lru_cache(maxsize=512)
def _terms(weights: bytes, period: float, centre: float) -> Array:
    """Average the model spectra of noise over the passband of a window at a frequency; all flights share windows."""
    weight = np.frombuffer(weights)
    through = np.abs(np.fft.rfft(weight, _PADDED * len(weight))) ** 2
    offset = np.fft.rfftfreq(_PADDED * len(weight), period)
    both = np.concatenate([centre - offset[:0:-1], centre + offset])
    share = np.concatenate([through[:0:-1], through])
    phase = 2 * np.pi * both * period
    rising = both**2
    colours = [1 / (1 + rho**2 - 2 * rho * np.cos(phase)) for rho in CORRELATIONS]
    spectra = np.array([spectrum for colour in colours for spectrum in (colour, rising * colour)])
    return np.asarray(spectra @ share / share.sum())


def _best_pair(relative: Array) -> int:
    """Choose a flat and a rising spectrum, neither negative, with the least residual, of all pairs by formula."""
    # The residual does not depend on the unit, and fourth powers stay within range.
    scaled = relative / relative.max()
    flat, rising = scaled[:, ::2, None], scaled[:, None, 1::2]
    flat_squared, rising_squared, both = (each.sum(axis=0) for each in (flat**2, rising**2, flat * rising))
    flat_sum, rising_sum = flat.sum(axis=0), rising.sum(axis=0)
    determinant = flat_squared * rising_squared - both**2
    # Where both are the same spectrum no pair has a solution, and one alone is taken.
    with np.errstate(divide="ignore", invalid="ignore"):
        much_flat = (rising_squared * flat_sum - both * rising_sum) / determinant
        much_rising = (flat_squared * rising_sum - both * flat_sum) / determinant
    fits = flat * (flat_sum / flat_squared), rising * (rising_sum / rising_squared)
    of_flat, of_rising, together = (
        ((1 - fitted) ** 2).sum(axis=0) for fitted in (*fits, much_flat * flat + much_rising * rising)
    )
    alone = np.minimum(of_flat, of_rising)
    misfit = np.where((much_flat >= 0) & (much_rising >= 0), together, alone)
    # Of so many powers a misfit is no surer than this ratio, and colour is believed beyond it.
    unsure = 1 + ERRORS / np.sqrt(len(relative))
    return 0 if misfit[0, 0] <= unsure * misfit.min() else int(np.argmin(misfit))
