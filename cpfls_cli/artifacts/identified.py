"""The artifact of an identified model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.checkpoint import HistoryGroup
from cpfls_cli.artifacts.evidence import (
    CurvesGroup,
    PeriodGroup,
    PhysicsGroup,
    ResidualsGroup,
    RoundTripGroup,
    StepsGroup,
    StructuresGroup,
    UncertaintyGroup,
    VerdictGroup,
    evidence_groups,
)
from cpfls_cli.artifacts.learned import LearnedGroup
from cpfls_cli.artifacts.model import (
    InertiaFunctionsGroup,
    ModelRecord,
    VehicleGroup,
)
from cpfls_cli.artifacts.scores import MODEL, TRAINING, JudgedGroup
from cpfls_cli.artifacts.spec import BODY, EULER, Format, dataset, group, group_of, record
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.validation.trust import Trust

if TYPE_CHECKING:
    from cpfls_cli.identification.identify import Identification
    from cpfls_cli.playback.model import VehicleModel
    from cpfls_cli.validation.validate import Validation

WELL_CONDITIONED = 100.0
"""Largest condition number of a model whose coefficients are all known."""


@record
class ChosenGroup:
    """What was chosen for the inertia functions."""

    weights: Array = dataset("partition weights a_i of the chosen chromosome", "gene")
    base: str = dataset("none or rigid-body")
    ridge_weight: float = dataset("chosen; infinite means the fuzzy part is off", gaps=True)


@record
class SolveGroup:
    """How well the training samples determine the coefficients."""

    singular_values: Array = dataset("of the regressor of the parameters in use, without penalty", "value", units="SI")
    rank: int = dataset("numerical rank")
    condition_number: float = dataset("over the kept singular values", least=1.0)
    parameters: int = dataset("number of linear parameters in use")


@record
class RulesGroup:
    """Excitation of each rule in training."""

    name: tuple[str, ...] = dataset("inertia function and rule", "rule")
    firing: Array = dataset("largest firing strength in training", "rule")
    determined: Array = dataset("share of the rule's coefficients that data determine", "rule")
    excited: BoolArray = dataset("1 where the rule is excited, else 0", "rule")


@record
class FrontGroup:
    """Pareto front of the search."""

    chromosomes: IntArray = dataset("Pareto front, 16-bit weights", "member", "gene")
    objectives: Array = dataset(
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "member",
        "3",
        units="SI",
    )
    chosen: int = dataset("index of the chosen member", into="member")
    held_out: Array | None = dataset(
        "mean squared error on the flights kept for the choice; objective 1 of them",
        "member",
        units="SI",
        gaps=True,
        default=None,
    )


@record
class SearchGroup:
    """How the search ended."""

    stop_reason: str | None = dataset("generations, converged, time-limit or interrupted", default=None)
    complete: bool | None = dataset("1 where the search ran to the end, 0 where `--resume` continues it", default=None)


@record
class BaselinesGroup:
    """Inertia parameters of the baselines."""

    rigid_body: Array = dataset("six inertia parameters by least squares", "6", units="kg m^2", frame=BODY)
    constant_inertia: Array = dataset("J11 J22 J33 J12 J13 J23, constant", "6", units="kg m^2", frame=EULER)


@record
class RidgeGroup:
    """Cross-validation of the ridge weight."""

    weight: Array = dataset("ridge weights tried", "tried", gaps=True)
    error: Array = dataset("cross-validated error", "tried")
    standard_error: Array = dataset("its standard error", "tried")


@record
class IdentifiedVehicleGroup(VehicleGroup):
    """A vehicle with inertia functions, which are what is identified."""

    inertia_functions: InertiaFunctionsGroup = group()


@record
class IdentifiedRecord(ModelRecord):
    """The artifact `cpfls/model` of an identified model: its inertia functions, with mass and rotors of the config."""

    FORMAT: ClassVar = Format(
        "cpfls/model",
        "an identified model, how it was found and how it was judged",
        "identify",
        ("flight", "selection", "validate", "choose-on"),
        kind="identified",
    )
    MADE_BY: ClassVar = "identify"

    vehicle: IdentifiedVehicleGroup = group()
    chosen: ChosenGroup = group("model")
    solve: SolveGroup = group()
    rules: RulesGroup = group()
    front: FrontGroup = group()
    history: HistoryGroup = group()
    search: SearchGroup | None = group(default=None)
    judged: JudgedGroup = group()
    baselines: BaselinesGroup = group()
    ridge: RidgeGroup | None = group(default=None)
    training_indices: IntArray = dataset("samples of the flight that trained", "sample", path="training/indices")
    findings: tuple[str, ...] = dataset("what failed or was not excited, in words", "finding")
    structures: StructuresGroup | None = group(default=None)
    residuals: ResidualsGroup | None = group(default=None)
    uncertainty: UncertaintyGroup | None = group(default=None)
    curves: CurvesGroup | None = group(default=None)
    round_trip: RoundTripGroup | None = group(default=None)
    steps: StepsGroup | None = group(default=None)
    physics: PhysicsGroup | None = group(default=None)
    period: PeriodGroup | None = group(default=None)
    verdict: VerdictGroup | None = group(default=None)

    @classmethod
    def of(
        cls,
        result: Identification,
        base: str,
        learned: IntArray,
        evidence: Validation | None,
        vehicle: VehicleModel,
        parts: LearnedGroup,
    ) -> Self:
        """Arrange an identification and the evidence on it; the vehicle is the stated one with another inertia."""
        baselines = {baseline.name: baseline.parameters for baseline in result.baselines}
        return cls(
            vehicle=IdentifiedVehicleGroup.of(vehicle),
            learned=parts,
            chosen=group_of(ChosenGroup, result.fit, weights=result.front.chromosomes[result.front.chosen], base=base),
            solve=group_of(SolveGroup, result.system),
            rules=group_of(RulesGroup, result.excitation),
            front=group_of(FrontGroup, result.front),
            history=group_of(HistoryGroup, result.history),
            search=SearchGroup(stop_reason=result.stop_reason, complete=result.complete),
            judged=JudgedGroup.of(result),
            baselines=BaselinesGroup(
                rigid_body=baselines["rigid-body"], constant_inertia=baselines["constant-inertia"]
            ),
            ridge=None if result.ridge is None else group_of(RidgeGroup, result.ridge),
            training_indices=learned,
            findings=tuple(result.findings),
            **({} if evidence is None else evidence_groups(evidence)),
        )

    @property
    def chosen_on(self) -> frozenset[str]:
        """Hashes of the flights that it was chosen on, among several."""
        inputs = {} if self.header is None else self.header.inputs
        return frozenset(file.sha256 for role, file in inputs.items() if role.startswith("choose-on"))

    @property
    def functions(self) -> InertiaFunctionsGroup:
        """Its inertia functions."""
        return self.vehicle.inertia_functions

    @property
    def complete(self) -> bool:
        """Whether the search came to its end; models of before searches could be stopped did."""
        return self.search is None or self.search.complete is not False

    @property
    def stop_reason(self) -> str:
        """Why the search ended; empty where that is not known."""
        return (self.search and self.search.stop_reason) or ""

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return "" if self.complete else self.stop_reason or "unknown"

    @property
    def searched(self) -> bool:
        """Whether it has partitions to search for; without, one chromosome was evaluated."""
        return bool(np.size(self.chosen.weights))

    @property
    def on_rigid_body(self) -> bool:
        """Whether a rigid body lies under the fuzzy part."""
        return self.chosen.base == "rigid-body"

    @property
    def fuzzy_part_off(self) -> bool:
        """Whether cross-validation switched the fuzzy part off."""
        return bool(np.isinf(self.chosen.ridge_weight))

    @property
    def same_everywhere(self) -> bool:
        """Whether one rule acts at all attitudes, and training went all the way round in roll and in pitch."""
        functions = [name.split(" rule ")[0] for name in self.rules.name]
        visited = np.asarray(self.functions.visited, dtype=bool)
        return len(set(functions)) == len(functions) and all(bool(visited.any(axis=axis).all()) for axis in (0, 1))

    @property
    def known_everywhere(self) -> bool:
        """Whether its one rule is known well enough to hold at attitudes that training did not visit."""
        full = self.solve.rank == self.solve.parameters
        return self.same_everywhere and full and self.solve.condition_number <= WELL_CONDITIONED

    @property
    def trust(self) -> str:
        """How far to trust it by its verdict, a word of `Trust`; of a file by a newer program possibly another."""
        return Trust.NOT_JUDGED if self.verdict is None or self.verdict.label is None else self.verdict.label

    @property
    def validated(self) -> bool:
        """Whether any evidence was gathered for it."""
        evidence = (self.structures, self.residuals, self.uncertainty, self.curves, self.round_trip, self.steps)
        return any(part is not None for part in (*evidence, self.physics, self.period, self.verdict))

    @property
    def summary(self) -> dict[str, Any]:
        """The model for machines.

        ``not_positive_definite`` is None: only the identification itself counts the training samples at which D(q) is
        not positive definite.
        """
        judged, solve = self.judged, self.solve
        return {
            **judged.summary_of(MODEL, TRAINING),
            "condition_number": solve.condition_number,
            "rank": solve.rank,
            "parameters": solve.parameters,
            "generations": len(self.history.evaluations) - 1,
            "evaluations": int(self.history.evaluations[-1]),
            "stop_reason": self.stop_reason,
            "complete": self.complete,
            "front": len(self.front.objectives),
            "choice_error": None if self.front.held_out is None else float(np.min(self.front.held_out)),
            "samples": judged.samples_of(TRAINING),
            "learned": len(self.training_indices),
            "ridge_weight": self.chosen.ridge_weight,
            "fuzzy_part": "off" if self.fuzzy_part_off else "on",
            "inertia_kg_m2": {
                "found": dict(zip(INERTIA_PARAMETERS, self.baselines.rigid_body.tolist(), strict=True)),
                "stated": dict(zip(INERTIA_PARAMETERS, self.vehicle.inertia.tolist(), strict=True)),
            },
            "not_positive_definite": None,
            "baselines": {name: judged.summary_of(name, TRAINING) for name in judged.baselines},
            "held_out": {part: self._held_out_summary(part) for part in judged.held_out},
            "findings": list(self.findings),
            "verdict": None if self.verdict is None or self.verdict.label is None else self.verdict.summary,
            **self.provenance,
        }

    def _held_out_summary(self, part: str) -> dict[str, Any]:
        judged = self.judged
        return {
            **judged.summary_of(MODEL, part),
            "samples": judged.samples_of(part),
            "outside": int(judged.outside[judged.parts.index(part)]),
            "baselines": {name: judged.summary_of(name, part) for name in judged.baselines},
        }
