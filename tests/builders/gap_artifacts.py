"""Results of the gap workflow with numbers made up, sound by their formats."""

from dataclasses import replace

import numpy as np

from cpfls_cli import page
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement, Extended
from cpfls_cli.consistency.check import Audit
from cpfls_cli.consistency.findings import AuditFinding, FaultNumber
from cpfls_cli.effects.signals import RecordedFlight
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.before_after import FreeRuns, PlaybackChange, ResidualChange, WorstWindows
from cpfls_cli.gap.compare import ChannelGaps, ResidualWindows
from cpfls_cli.gap.naming.results import Alternative, ByKind, Estimate, GapChange, NamedEffect, NotExcited
from cpfls_cli.gap.residual.dependence import Dependence, GapStretch, HeatMap
from cpfls_cli.gap.residual.repeated import Repeatability
from cpfls_cli.playback.errors import AlongFlights, Errors, Prediction
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.source import source_of_result
from cpfls_cli.stage import loaded
from cpfls_cli.store import Origin
from cpfls_cli.vehicle.settings import VehicleSettings

WINDOWS, HORIZON = 60, 50
SENTENCE = "The centre of mass is not where the model has it."
RIVAL = Alternative("torque_bias", "com_offset", 0.98, "change the thrust")
NUMBERS = {"parameter_error": Estimate("inertia_z", "1", 0.24, 0.2, 0.281, (-0.9, 3.0))}
C_X = Estimate("c_x", "m", 0.01, 0.009, 0.0111, (-0.06, 0.06))
AUDIT = Audit(
    findings=(),
    untested=dict.fromkeys(("gyro_scale", "imu_misalignment"), "no attitude"),
    warnings=(),
    notes=("The motion follows the rotors by 12 ms.",),
)
UNSEEN = (NotExcited("ground_effect", "fly near the ground"),)
VEHICLE_NUMBERS = (Estimate("inertia_x", "1", 0.021, 0.01, 0.03, (np.nan, np.nan)),)


def audit_with_fault(**changed):
    """Make an audit that found the error of a gyroscope."""
    number = FaultNumber(name="x", value=0.01, unit="rad/s", low=0.008, high=0.012, named=True)
    sentence = "The gyroscope shows 0.01 rad/s at rest."
    fault = AuditFinding(name="gyro_bias", coefficients=(number,), p_value=1e-9, named=True, sentence=sentence)
    return replace(AUDIT, findings=(fault,), **changed)


def flights(roles=("training", "held-out")):
    """Two flights of four samples each."""
    still = {"time": 0.01 * np.arange(4), "body_rate": np.zeros((4, 3))}
    return {
        f"flight-{number}": RecordedFlight(name=name, role=role, commanded=False, begins=np.nan, **still)
        for number, (name, role) in enumerate(zip(("one.csv", "two.csv"), roles, strict=True), start=1)
    }


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


def effect(name="com_offset"):
    """Make an effect that explains most of a gap."""
    linear = [0.01] if name == "com_offset" else []
    return named_effect(name, None, linear, [NUMBERS.get(name, C_X)], 1e-9, 0.93, SENTENCE)


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


def along(kind, *predictions, **sizes):
    """Errors that grow with the horizon; by signal those of the predictions after the last sample."""
    given = {"body_rate": (0.1, 1.0, 1.0, 2.0), "attitude": (0.01, 0.2, 0.1, 0.3)} | sizes
    growth = np.arange(1, HORIZON + 1) / HORIZON

    def errors(end):
        return Errors(mae=end * growth, rms_by_axis=np.repeat(end * growth[:, None], 3, axis=1))

    models = {
        name: Prediction(diverged=0, **{signal: errors(ends[place]) for signal, ends in given.items()})
        for place, name in enumerate(predictions)
    }
    return kind(horizon_s=np.arange(1, HORIZON + 1) * 0.01, models=models, flights=("two.csv",), windows=60)


def played_pair(**sizes):
    return along(PlaybackChange, "after", "nothing-moves", "rate-stays", "before", **sizes)


def by_channel(torque, force):
    """Six values; those of force only where there are some."""
    return np.array([*torque, *(force or [np.nan] * 3)])


def disagreement(force=True, floors=None, **changed):
    if floors is None:
        floors = by_channel([12.0, 3.0, 0.8], force and [5.0, 4.0, 70.0])
    cells = np.outer(np.linspace(-1, 1, 12), np.ones(12)) * 0.01
    cells[0, :5] = np.nan
    pairs = [(of, "thrust", 0.9, 0.004) for of in CHANNELS] + [(of, "yaw", 0.6, 0.3) for of in CHANNELS]
    given = {
        "sizes": ChannelGaps(
            rms=floors * 0.01, floor=np.where(np.isfinite(floors), 0.01, np.nan), floors=floors, share=floors / 100
        ),
        "worst": (GapStretch(1, 1.0, 2.0, "torque x", 33.3), GapStretch(0, 3.0, 4.0, "torque y", 9.9)),
        "dependence": tuple(Dependence(*row) for row in pairs if force or row[0].startswith("torque")),
        "heat_map": HeatMap(
            channel="torque x",
            signals=("thrust", "yaw"),
            first_edge=np.linspace(50, 70, 13),
            second_edge=np.linspace(-3, 3, 13),
            mean=cells,
            count=np.ones((12, 12)),
        ),
        "not_excited": UNSEEN,
        "audit": AUDIT,
        "residual": ResidualWindows(
            time=np.tile(np.arange(WINDOWS // 2) * 0.2, 2),
            flight=np.repeat([0, 1], WINDOWS // 2),
            value=np.random.default_rng(1).standard_normal((WINDOWS, 6)) * floors * 0.01,
        ),
        "playback": along(AlongFlights, "model", "nothing-moves", "rate-stays"),
        "warnings": ("one.csv: rotor 2 looks saturated",),
    }
    return Disagreement(
        base=VehicleModel(vehicle=VehicleSettings()), recorded=flights(("given",) * 2), **given | changed
    )


def gap_change(before=None, after=None, force=True):
    """Make the gap before and after of what they are in noise floors."""
    before = by_channel([40.0, 3.0, 0.9], force and [5.0, 4.0, 70.0]) if before is None else before
    after = by_channel([1.1, 0.01, 0.9], force and [0.9, 0.8, 1.2]) if after is None else after
    floor = 0.01234
    return GapChange(
        before=before * floor,
        after=after * floor,
        floor=np.where(np.isfinite(before), floor, np.nan),
        before_floors=before,
        after_floors=after,
    )


def diagnosis(verdict="NAMED", named=("com_offset",), force=True, **changed):
    """Make a diagnosis that names effects."""
    time, gap = np.arange(200) * 0.01, gap_change(force=force)
    waves = np.sin(3 * time)[:, None] * np.ones(3)
    before = np.outer(np.arange(WINDOWS) < 0.75 * WINDOWS, gap.before)
    given = {
        "share": 0.973,
        "share_by_kind": ByKind(torque=np.nan, force=np.nan),
        "effects": tuple(map(effect, named)),
        "not_excited": UNSEEN,
        "vehicle_numbers": VEHICLE_NUMBERS,
        "gap": gap,
        "notes": ("A note that readers need.",),
        "playback": played_pair(),
        "worst": (GapStretch(0, 5.0, 6.2, "torque x", 90.0), GapStretch(0, 1.0, 2.5, "force z", 80.0)),
        "residual": ResidualChange(
            time=np.arange(WINDOWS) * 0.2,
            flight=np.zeros(WINDOWS, dtype=int),
            before=before,
            parameters=before,
            after=np.zeros((WINDOWS, 6)),
        ),
        "picture": WorstWindows(
            flight="two.csv",
            channel="torque x",
            time=time,
            measured=waves[:, 0],
            before=waves[:, 0] + 0.2,
            after=waves[:, 0],
        ),
        "run": FreeRuns(
            flight="two.csv",
            axis=1,
            time=time,
            restart=np.array([0.0, 1.0]),
            measured=waves,
            before=waves + 30 * (time % 1.0)[:, None],
            after=waves,
        ),
        "audit": AUDIT,
        "split": "no flight was held out by name",
        "warnings": (),
        **dict.fromkeys(("contradictions", "differences", "closest", "alternatives", "sets", "unexplained"), ()),
    }
    base = VehicleModel(vehicle=VehicleSettings())
    return Diagnosis(verdict=verdict, base=base, recorded=flights(), **given | changed)


def extended(**changed):
    given = {"effects": (effect(),), "vehicle_numbers": VEHICLE_NUMBERS, "gap": gap_change(), "playback": played_pair()}
    return Extended(
        model=replace(VehicleModel(vehicle=VehicleSettings()), repairs=AUDIT),
        inertia=np.array([0.61, 0.6, 1.2, 0.0, 0.0, 0.0]),
        thrust_scale=1.0123,
        **given | changed,
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
