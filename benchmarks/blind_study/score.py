"""What the judge said next to what was hidden."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.blind.cases import LACKING
from benchmarks.blind_study.truth import ROUGH, coefficients

VISIBLE = 0.7
"""Hidden torque in floors, on its largest axis, below which nobody can see it."""

RIGHT = "right"
EXTRA = "right and more"
PARTIAL = "right, called partial"
SOME = "some"
RIVAL = "among the rivals"
WRONG = "wrong"
REFUSED = "refused"
MISSED = "missed"
UNSEEN = "not visible"
ERROR = "error"
_CANCELS = 0.3
"""Share of the gap beyond all of it, or below none, from which on effects work against one another."""

CERTAIN = ("NAMED", "AMBIGUOUS")


@dataclass(frozen=True)
class Scored:
    """A judged set: the key, what was said of it, and how the two compare."""

    key: dict
    said: dict
    outcome: str

    @property
    def truth(self):
        """Names that a perfect judge would give."""
        return frozenset(self.key["truth"])

    @property
    def names(self):
        """Names that were given, those that explain most first."""
        return tuple(effect["name"] for effect in self.said["effects"])

    @property
    def verdict(self):
        """The word for it all."""
        return self.said["verdict"]

    @property
    def false_names(self):
        """Names of what is not hidden; a form close to one of the catalogue allows the nearest."""
        return set(self.names) - self.truth - set(self.key["hidden"]) - set(self.key["nearest"])

    @property
    def wrong_name(self):
        """Whether a certain verdict rests on nothing but names of what is not there."""
        rightly = self.outcome == RIVAL or set(self.names) - self.false_names
        return self.verdict in CERTAIN and bool(self.names) and not rightly

    @property
    def false_name(self):
        """Whether a certain verdict holds a name of what is not there."""
        return self.verdict in CERTAIN and self.outcome != RIVAL and bool(self.false_names)

    @property
    def good(self):
        """Whether the answer is the one that is asked for."""
        if self.key["outside"]:
            return self.verdict not in CERTAIN
        if self.key["group"] == "none":
            return not self.names
        if self.key["only"]:
            return "DIFFER" in self.verdict
        if self.key["group"] == "lacking":
            return self._says_what_to_log() if self.outcome == RIVAL else not self.false_name
        if self.key["group"] == "attack" and not self.truth:
            return not self.names
        if self.key["group"] in ("hover", "no_velocity", "no_force", "form", "pybullet"):
            return not self.false_name and not self.unphysical
        if self.key["group"] == "background":
            return self.names[:1] == (self.key["dominant"],) and not self.false_name
        return self.outcome == RIGHT

    def _says_what_to_log(self):
        """Tell whether a signal that the log lacks is named where the rivals are."""
        separated = [rival["separated_by"] for rival in self.said["alternatives"] if rival["name"] in self.truth]
        text = " ".join(separated)
        return any(signal in text for signal, columns in LACKING.items() if {*columns} <= {*self.key["left_out"]})

    @property
    def unphysical(self):
        """Whether a certain verdict has numbers at or beyond their bounds, or effects that cancel one another."""
        effects = self.said["effects"] if self.verdict in CERTAIN else []
        numbers = [number for effect in effects for number in effect["coefficients"].values()]
        cancel = any(not -_CANCELS <= effect["share"] <= 1 + _CANCELS for effect in effects)
        return cancel or any(_at_bound(number["value"], *number["possible"]) for number in numbers)

    @property
    def visible(self):
        """Hidden torque in floors, on the axis where it is largest."""
        return visible(self.key, self.said)

    @property
    def usual(self):
        """Whether it was flown in still air, each path once, and its log held no setpoints."""
        return "instruments" not in self.key

    @property
    def air(self):
        """The level of the gusts, and what separates them from the vehicle."""
        return f"gusts {self.key.get('gusts', 0)}, {self.key.get('instruments', 'none')}"

    @property
    def noise(self):
        """Size and kind of the noise, and the air unless it is still."""
        noise = f"{self.key['level']} {self.key['kind']}"
        return noise if self.usual else f"{noise}, {self.air}"

    @property
    def over_air(self):
        """Hidden torque over that of the gusts, both in averages over windows, on the axis where that is largest."""
        if "averaged_n_m" not in self.key:
            return float("nan")
        own, gusts = (
            _over_flights(self.key[name], self.key["only"]) for name in ("averaged_n_m", "gusts_averaged_n_m")
        )
        return float((own / gusts).max())

    def floors(self, when):
        """Give the held-out torque gap in floors, on the axis where it was largest before."""
        before = np.array(self.said["gap_before"]["floors"][:3], dtype=float)
        if np.isnan(before).all():
            return float("nan")
        return float(np.array(self.said[f"gap_{when}"]["floors"], dtype=float)[np.nanargmax(before)])


@dataclass(frozen=True)
class Number:
    """A coefficient of a rightly named effect next to the hidden one."""

    effect: str
    name: str
    level: str
    kind: str
    true: float
    value: float
    scale: float
    inside: bool

    @property
    def error(self):
        """Relative to the largest number of its kind."""
        return (self.value - self.true) / self.scale


def _at_bound(value, low, high):
    if value is None or None in (low, high):
        return False
    near = 1e-6 * (high - low)
    # A bound at zero is where an effect ends, and a number of a group may well be zero.
    return value < low - near or value > high - near or (low != 0 and value < low + near)


def scored(folder):
    """Join keys and results."""
    folder = Path(folder)
    out = []
    for line in (folder / "results.jsonl").read_text(encoding="utf-8").splitlines():
        said = json.loads(line)
        key = json.loads((folder / "keys" / said["set"] / "key.json").read_text(encoding="ascii"))
        out.append(Scored(key, said, outcome(key, said)))
    return sorted(out, key=lambda each: (each.key["case"], each.key["level"], each.key["kind"]))


def visible(key, said):
    """Give the hidden torque of the held-out flights in floors, on its largest axis."""
    if "floor" not in said:
        return float("nan")
    hidden = _over_flights(key["residual_rms_n_m"], key["only"])
    return float(np.nanmax(hidden / np.array(said["floor"][:3], dtype=float)))


def _over_flights(sizes, only):
    """Average root mean squares over the flights of a role, the held-out ones if all have it, shape (3,)."""
    own = [values for name, values in sizes.items() if name.startswith(only or "held_out")]
    return np.sqrt(np.mean(np.square(own), axis=0))


def outcome(key, said):
    """Compare the names given with those hidden; wind acts through rotor drag, so a wind includes its drag."""
    if said["verdict"] == "ERROR":
        return ERROR
    truth, names = set(key["truth"]), {effect["name"] for effect in said["effects"]}
    if not names:
        return _nothing_named(key, said)
    # Yaw alone shows the ratio of drag factor and Izz, so that either name is right, but not both.
    if "drag_factor" in key["hidden"] and "parameter_error" not in names:
        names = {"parameter_error" if name == "drag_factor_error" else name for name in names}
    if "wind" in truth:
        names |= {"rotor_drag"} if "wind" in names else set()
        truth |= {"rotor_drag"}
    if names == truth:
        return PARTIAL if said["verdict"] in ("PARTIAL", "UNEXPLAINED", "CONTRADICTED") else RIGHT
    if said["verdict"] == "AMBIGUOUS" and _with_rivals(said, names, truth):
        return RIVAL
    if truth and names > truth:
        return EXTRA
    return SOME if names & truth else WRONG


def _nothing_named(key, said):
    quiet = said["verdict"] in ("NO_GAP", "NOT_EXCITED")
    if not key["truth"]:
        return RIGHT if quiet else REFUSED
    if not quiet:
        return REFUSED
    return MISSED if visible(key, said) >= VISIBLE else UNSEEN


def _with_rivals(said, names, truth):
    """Tell whether a listed rival, with what it needs next to it, makes the answer right in the place of a name."""
    return any(
        names - {rival["instead_of"]} | {rival["name"], rival.get("jointly_with") or rival["name"]} == truth
        for rival in said["alternatives"]
    )


def numbers(each):
    """Compare the coefficients of rightly named effects with the hidden ones."""
    true = coefficients(each.key)
    return [
        number
        for effect in each.said["effects"]
        if effect["name"] in each.truth and effect["name"] in true
        for number in _compared(each, effect, true[effect["name"]])
    ]


def _compared(each, effect, true):
    known = [(name, found, _named_alike(name, true)) for name, found in effect["coefficients"].items()]
    known = [(name, found, value) for name, found, value in known if value is not None]
    for name, found, value in known:
        scale = max(abs(other) for _, more, other in known if more["unit"] == found["unit"])
        inside = None not in (found["low"], found["high"]) and found["low"] <= value <= found["high"]
        noise = each.key["level"], each.key["kind"]
        yield Number(effect["name"], name, *noise, value, found["value"], max(scale, 1e-12), inside)


def _named_alike(name, true):
    """Find a coefficient; the audit of the sensors calls b_x and delay_s just x and delay."""
    alike = [value for own, value in true.items() if name == own or name in (own.split("_")[0], own.split("_")[-1])]
    return true.get(name, alike[0] if alike else None)


def exact(number):
    """Tell whether the hidden form is that of the catalogue."""
    return number.effect not in ROUGH
