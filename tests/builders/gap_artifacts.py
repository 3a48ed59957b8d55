"""Artifacts of the gap workflow with numbers made up, quick to write and sound by their formats."""

from dataclasses import replace

import numpy as np

from cpfls_cli import page
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement, Extended
from cpfls_cli.consistency.check import Audit
from cpfls_cli.consistency.findings import AuditFinding, FaultNumber
from cpfls_cli.effects.signals import RecordedFlight
from cpfls_cli.gap.before_after import FreeRuns, PlaybackChange, ResidualChange, WorstWindows
from cpfls_cli.gap.compare import ChannelGaps, ResidualWindows
from cpfls_cli.gap.naming.results import (
    Alternative,
    ByKind,
    Estimate,
    GapChange,
    LikelySet,
    NamedEffect,
    NotExcited,
    Unexplained,
)
from cpfls_cli.gap.residual.dependence import Dependence
from cpfls_cli.gap.residual.repeated import Repeatability
from cpfls_cli.gap.residual.views import GapStretch, HeatMap
from cpfls_cli.playback.errors import AlongFlights, Errors, Prediction
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.source import source_of_result
from cpfls_cli.stage import loaded
from cpfls_cli.store import Origin
from cpfls_cli.vehicle.settings import VehicleSettings

CHANNELS = np.array([f"{kind} {axis}" for kind in ("torque", "force") for axis in "xyz"])
WINDOWS, HORIZON = 60, 50
SENTENCE = "The centre of mass is not where the model has it."
EFFECT = {
    "name": "com_offset",
    "kind": "wrench",
    "named": 1,
    "p_value": 1e-9,
    "share": 0.93,
    "sentence": SENTENCE,
}

OFFSET = ("c_x", "m", 0.01, 0.009, 0.0111, -0.06, 0.06)
NUMBERS = {"parameter": ("inertia_z", "1", 0.24, 0.2, 0.281, -0.9, 3.0)}
"""A coefficient of an effect, by the kind of the effect."""


def texts(*values):
    return np.array(values) if values else np.array([], dtype="U1")


def table(group, fields, rows):
    """Arrange rows as datasets; a field that starts with a quote holds text."""
    columns = {}
    for place, field in enumerate(fields):
        values = [row[place] for row in rows]
        words = field.startswith("'")
        columns[f"{group}/{field.lstrip(chr(39))}"] = texts(*values) if words else np.array(values, dtype=float)
    return columns


def audit(findings=()):
    return {
        **table("audit", ("'finding", "named", "p_value", "'sentence"), findings),
        **table(
            "audit_coefficient",
            ("'finding", "'name", "'unit", "value", "low", "high", "named"),
            [(finding[0], "x", "rad/s", 0.01, 0.008, 0.012, finding[1]) for finding in findings],
        ),
        "audit/untested": texts("gyro_scale: no attitude", "imu_misalignment: no attitude"),
        "audit/warning": texts(),
        "audit/note": texts("The motion follows the rotors by 12 ms."),
    }


def flights(roles=("training", "held-out")):
    """Two flights of four samples each."""
    pairs = zip(("one.csv", "two.csv"), roles, strict=True)
    still = {"time": 0.01 * np.arange(4), "body_rate": np.zeros((4, 3))}
    return {
        f"flight-{number}": RecordedFlight(name=name, role=role, commanded=False, begins=np.nan, **still)
        for number, (name, role) in enumerate(pairs, start=1)
    }


def rows(data, group, *names):
    """List the rows of a table that is given as datasets."""
    return list(zip(*(data[f"{group}/{name}"].tolist() for name in names), strict=True))


def part(kind, data, group):
    """Make a result of the datasets of a group; None where there are none."""
    held = {path.removeprefix(f"{group}/"): each for path, each in data.items() if path.startswith(f"{group}/")}
    return kind(**held) if held else None


def audited(data):
    """Make an audit of its datasets."""
    numbers = rows(data, "audit_coefficient", "finding", "name", "unit", "value", "low", "high", "named")
    return Audit(
        findings=tuple(
            AuditFinding(
                name=name,
                coefficients=tuple(
                    FaultNumber(name=of, value=value, unit=unit, low=low, high=high, named=bool(sure))
                    for owner, of, unit, value, low, high, sure in numbers
                    if owner == name
                ),
                p_value=p_value,
                named=bool(named),
                sentence=sentence,
            )
            for name, named, p_value, sentence in rows(data, "audit", "finding", "named", "p_value", "sentence")
        ),
        untested=dict(each.split(": ", 1) for each in data["audit/untested"].tolist()),
        warnings=tuple(data["audit/warning"].tolist()),
        notes=tuple(data["audit/note"].tolist()),
        contradictions=tuple(data["audit/contradiction"].tolist()) if "audit/contradiction" in data else (),
    )


def along(kind, data):
    """Make a playback of its datasets."""
    names, signals = data["playback/prediction"].tolist(), ("body_rate", "attitude", "velocity", "position")
    return kind(
        horizon_s=data["playback/horizon_s"],
        models={
            name: Prediction(
                diverged=0,
                **{
                    signal: Errors(
                        mae=data[f"playback/{signal}/mae"][row], rms_by_axis=data[f"playback/{signal}/rms"][row]
                    )
                    for signal in signals
                    if f"playback/{signal}/mae" in data
                },
            )
            for row, name in enumerate(names)
        },
        flights=tuple(data["playback/flight"].tolist()),
        windows=60,
    )


def stretches(data):
    """Make stretches of their datasets."""
    found = rows(data, "stretch", "flight", "start", "end", "channel", "floors")
    return tuple(GapStretch(int(flight), *others) for flight, *others in found)


def unseen(data):
    """Make effects that were not excited of their datasets."""
    return tuple(NotExcited(*row) for row in rows(data, "not_excited", "name", "reason"))


def effects_of(data, named):
    """Make effects of their datasets: those that are named, or those that are the closest."""
    numbers = rows(
        data, "coefficient", "effect", "name", "unit", "value", "low", "high", "plausible_low", "plausible_high"
    )
    columns = ("name", "named", "p_value", "share", "sentence")
    return tuple(
        named_effect(
            name,
            linear=[value for owner, value in rows(data, "linear", "effect", "value") if owner == name],
            numbers=tuple(
                Estimate(*own, tuple(ends))
                for owner, *own, low, high in numbers
                if owner == name
                for ends in [(low, high)]
            ),
            p_value=p_value,
            share=share,
            sentence=sentence,
        )
        for name, is_named, p_value, share, sentence in rows(data, "effect", *columns)
        if bool(is_named) is named
    )


def numbers_of(data):
    """Make numbers of the vehicle of their datasets."""
    columns = ("name", "unit", "value", "low", "high")
    return tuple(Estimate(*row, (np.nan, np.nan)) for row in rows(data, "parameter", *columns))


def named_effect(name, shape=None, linear=(), numbers=(), p_value=0.001, share=1.0, sentence=""):
    """Make an effect with its numbers."""
    return NamedEffect(
        name=name,
        shape=shape or {},
        linear=np.array(linear, dtype=float),
        numbers=tuple(numbers),
        p_value=p_value,
        share=share,
        sentence=sentence,
    )


def source_of(given, stage, config="seed: 1\n", cautions=()):
    """Say where a result comes from, for its template."""
    origin = Origin(stage=stage, seed=1, config=config, cautions=tuple(cautions))
    return source_of_result(given, origin, f"{stage}.h5", f"{stage}.h5", "f" * 64)


def blocks_of(given, stage, **origin):
    """Give what a result says as blocks."""
    return page.blocks(text_of(given, stage, **origin))


def text_of(given, stage, **origin):
    """Word a result by the template of its stage."""
    return loaded(stage).text(given, about=source_of(given, stage, **origin))


def playback(*predictions, **sizes):
    """Errors that grow with the horizon; by signal those of the predictions after the last sample."""
    given = {"body_rate": (0.1, 1.0, 1.0, 2.0), "attitude": (0.01, 0.2, 0.1, 0.3)} | sizes
    data = {
        "playback/flight": texts("two.csv"),
        "playback/windows": 60,
        "playback/prediction": texts(*predictions),
        "playback/horizon_s": np.arange(1, HORIZON + 1) * 0.01,
        "playback/diverged": np.zeros(len(predictions), dtype=int),
    }
    growth = np.arange(1, HORIZON + 1) / HORIZON
    for signal, ends in given.items():
        mae = np.outer(ends[: len(predictions)], growth)
        data |= {f"playback/{signal}/mae": mae, f"playback/{signal}/rms": np.repeat(mae[:, :, None], 3, axis=2)}
    return data


def played_pair(**sizes):
    return playback("after", "nothing-moves", "rate-stays", "before", **sizes)


def disagreement(force=True, **changed):
    floors = np.array([12.0, 3.0, 0.8, *([5.0, 4.0, 70.0] if force else [np.nan] * 3)])
    rng = np.random.default_rng(1)
    cells = np.outer(np.linspace(-1, 1, 12), np.ones(12)) * 0.01
    cells[0, :5] = np.nan
    known = CHANNELS[: 6 if force else 3]
    pairs = [(channel, "thrust", 0.9, 0.004) for channel in known] + [(channel, "yaw", 0.6, 0.3) for channel in known]
    data = {
        "gap/channel": CHANNELS,
        "gap/rms": floors * 0.01,
        "gap/floor": np.where(np.isfinite(floors), 0.01, np.nan),
        "gap/floors": floors,
        "gap/share": floors / 100,
        "residual/time": np.tile(np.arange(WINDOWS // 2) * 0.2, 2),
        "residual/flight": np.repeat([0, 1], WINDOWS // 2),
        "residual/value": rng.standard_normal((WINDOWS, 6)) * floors * 0.01,
        **table(
            "stretch",
            ("flight", "start", "end", "'channel", "floors"),
            [(1, 1.0, 2.0, "torque x", 33.3), (0, 3.0, 4.0, "torque y", 9.9)],
        ),
        **table("dependence", ("'channel", "'signal", "r2", "p_value"), pairs),
        **playback("model", "nothing-moves", "rate-stays"),
        **table("not_excited", ("'name", "'reason"), [("ground_effect", "fly near the ground")]),
        **audit(),
        "warning": texts("one.csv: rotor 2 looks saturated"),
    } | changed
    return Disagreement(
        sizes=part(ChannelGaps, {path: each for path, each in data.items() if path != "gap/channel"}, "gap"),
        repeatability=None,
        worst=stretches(data),
        dependence=tuple(Dependence(*row) for row in rows(data, "dependence", "channel", "signal", "r2", "p_value")),
        heat_map=HeatMap(
            channel="torque x",
            signals=("thrust", "yaw"),
            first_edge=np.linspace(50, 70, 13),
            second_edge=np.linspace(-3, 3, 13),
            mean=cells,
            count=np.ones((12, 12)),
        ),
        not_excited=unseen(data),
        audit=audited(data),
        residual=part(ResidualWindows, data, "residual"),
        playback=along(AlongFlights, data),
        warnings=tuple(data["warning"].tolist()),
        base=VehicleModel(vehicle=VehicleSettings()),
        recorded=flights(("given", "given")),
    )


def effects(*rows):
    rows = [{**EFFECT, **row} for row in rows]
    order = ("name", "kind", "named", "p_value", "share", "sentence")
    coefficients = [(row["name"], *NUMBERS.get(row["kind"], OFFSET)) for row in rows]
    return {
        **table(
            "effect",
            ("'name", "'kind", "named", "p_value", "share", "'sentence"),
            [[row[key] for key in order] for row in rows],
        ),
        **table(
            "coefficient",
            ("'effect", "'name", "'unit", "value", "low", "high", "plausible_low", "plausible_high"),
            coefficients,
        ),
        **table("linear", ("'effect", "value"), [("com_offset", 0.01)]),
        **table("shape", ("'effect", "'name", "value"), []),
        **table("parameter", ("'name", "'unit", "value", "low", "high"), [("inertia_x", "1", 0.021, 0.01, 0.03)]),
    }


def sizes(force=True):
    before = np.array([40.0, 3.0, 0.9, *([5.0, 4.0, 70.0] if force else [np.nan] * 3)])
    after = np.array([1.1, 0.01, 0.9, *([0.9, 0.8, 1.2] if force else [np.nan] * 3)])
    return {
        "gap/channel": CHANNELS,
        "gap/before": before * 0.01234,
        "gap/after": after * 0.01234,
        "gap/floor": np.where(np.isfinite(before), 0.01234, np.nan),
        "gap/before_floors": before,
        "gap/after_floors": after,
    }


def pictures():
    time = np.arange(200) * 0.01
    waves = np.sin(3 * time)[:, None] * np.ones(3)
    return {
        "picture/flight": np.array("two.csv"),
        "picture/channel": np.array("torque x"),
        "picture/time": time,
        "picture/measured": waves[:, 0],
        "picture/before": waves[:, 0] + 0.2,
        "picture/after": waves[:, 0],
        "run/flight": np.array("two.csv"),
        "run/axis": 1,
        "run/time": time,
        "run/restart": np.array([0.0, 1.0]),
        "run/measured": waves,
        "run/before": waves + 30 * (time % 1.0)[:, None],
        "run/after": waves,
    }


def diagnosis(verdict="NAMED", named=({},), alternatives=(), unexplained=(), sets=(), force=True, **changed):
    data = {
        "verdict": np.array(verdict),
        "share": 0.973,
        "split": np.array("no flight was held out by name"),
        **effects(*named),
        **sizes(force),
        **played_pair(),
        **table(
            "stretch",
            ("flight", "start", "end", "'channel", "floors"),
            [(0, 5.0, 6.2, "torque x", 90.0), (0, 1.0, 2.5, "force z", 80.0)],
        ),
        "residual/time": np.arange(WINDOWS) * 0.2,
        "residual/flight": np.zeros(WINDOWS, dtype=int),
        "residual/before": np.outer(np.arange(WINDOWS) < 0.75 * WINDOWS, sizes(force)["gap/before"]),
        "residual/parameters": np.outer(np.arange(WINDOWS) < 0.75 * WINDOWS, sizes(force)["gap/before"]),
        "residual/after": np.zeros((WINDOWS, 6)),
        **pictures(),
        **table("not_excited", ("'name", "'reason"), [("ground_effect", "fly near the ground")]),
        **audit(),
        "note": texts("A note that readers need."),
    } | changed  # fmt: skip
    kinds, listed = data.get("share_by_kind", [np.nan, np.nan]), {name: tuple(data.get(name, ())) for name in LISTED}
    chosen = {path: each for path, each in data.items() if path != "gap/channel"}
    return Diagnosis(
        verdict=str(data["verdict"]),
        contradictions=tuple(map(str, listed["impossible"])),
        share=float(data["share"]),
        share_by_kind=ByKind(torque=float(kinds[0]), force=float(kinds[1])),
        differences=tuple(map(str, listed["difference"])),
        effects=effects_of(data, named=True),
        closest=effects_of(data, named=False),
        alternatives=tuple(Alternative(*row) for row in alternatives),
        sets=tuple(LikelySet(*row) for row in sets),
        unexplained=tuple(
            Unexplained(axis, floors, signal or None, part_, None if np.isnan(hz) else hz, energy)
            for axis, floors, signal, part_, hz, energy in unexplained
        ),
        not_excited=unseen(data),
        vehicle_numbers=numbers_of(data),
        gap=part(GapChange, chosen, "gap"),
        notes=tuple(map(str, listed["note"])),
        playback=along(PlaybackChange, data),
        worst=stretches(data),
        residual=part(ResidualChange, data, "residual"),
        picture=part(
            WorstWindows,
            data | {f"picture/{name}": str(data[f"picture/{name}"]) for name in ("flight", "channel")},
            "picture",
        ),
        run=part(FreeRuns, data | {"run/flight": str(data["run/flight"])}, "run"),
        audit=audited(data),
        split=str(data["split"]),
        warnings=tuple(map(str, listed["warning"])),
        base=VehicleModel(vehicle=VehicleSettings()),
        recorded=flights(),
    )


LISTED = ("impossible", "difference", "note", "warning")


def extended(**changed):
    data = {**effects({}), **sizes(), **played_pair(), **audit()} | changed
    return Extended(
        model=replace(VehicleModel(vehicle=VehicleSettings()), repairs=audited(data)),
        inertia=np.array([0.61, 0.6, 1.2, 0.0, 0.0, 0.0]),
        thrust_scale=1.0123,
        effects=effects_of(data, named=True),
        vehicle_numbers=numbers_of(data),
        gap=part(GapChange, {path: each for path, each in data.items() if path != "gap/channel"}, "gap"),
        playback=along(PlaybackChange, data),
    )


def repeatability(share, *, error=0.02, gap=4.0, noise=0.1, motion=8.0):
    """What of gaps comes again, shares by channel and band, of rad/s^2 and m/s^2 about a body of 1 kg m^2 and 1 kg."""
    share = np.array(share, dtype=float)
    total = np.full(share.shape, gap**2)
    low, high = [0.0, 2.0, 1.0, 0.5, 0.25, 0.0], [6.0, 6.0, 3.0, 1.5, 0.75, 0.25]
    return Repeatability(
        low=np.array(low),
        high=np.array(high),
        total=total,
        repeatable=share * total,
        noise=np.full(share.shape, noise**2),
        motion=np.full(share.shape, motion**2),
        share_error=np.full(share.shape, error),
        explained_error=np.full(share.shape, 0.05),
        resists=np.ones(6),
        flights=("one.csv", "two.csv"),
        runs=4,
        paths=1,
        blocks=np.full(6, 12),
    )
