"""An identified model: a vehicle with inertia functions, how it was found, how it was judged, how far to trust it."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.model import AnyModel, LearnedFlight
from cpfls_cli.dynamics import InertiaFunctions
from cpfls_cli.errors import InputError
from cpfls_cli.evolution.engine import History
from cpfls_cli.identification.data import TRAINING
from cpfls_cli.identification.findings import RuleExcitation
from cpfls_cli.identification.identify import MODEL, Identification, Judged
from cpfls_cli.identification.search import Front, StopReason, is_end
from cpfls_cli.identification.solver import RidgeCurve
from cpfls_cli.inertia import INERTIA_PARAMETERS, six_parameters
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import BODY, EULER, about, part, result
from cpfls_cli.validation.bands import Draws, Physics
from cpfls_cli.validation.replay import StepErrors
from cpfls_cli.validation.residuals import ResidualAnalysis
from cpfls_cli.validation.structures import StructureComparison
from cpfls_cli.validation.trust import Trust
from cpfls_cli.validation.validate import Curves, RoundTrip, Validation
from cpfls_cli.validation.verdict import Verdict

WELL_CONDITIONED = 100.0
"""Largest condition number of a model whose coefficients are all known."""


@result
class IdentifiedModel(AnyModel):
    """A vehicle with inertia functions, which were identified; mass and rotors are those of the config."""

    FORMAT: ClassVar = "cpfls/identified"
    MADE_BY: ClassVar = "identify"
    SHOWN: ClassVar = (
        *("trust", "complete", "generations", "evaluations", "front", "choice_error", "samples", "learned"),
        *("fuzzy_part", "inertia_kg_m2", "errors", "baselines", "held_out"),
    )

    model: VehicleModel = part()
    learned_from: tuple[LearnedFlight, ...] = part(default=())
    """Flights that it was found in."""
    kept_for_choice: tuple[str, ...] = about(
        "sha256 of the flights that it was chosen on, among several", "flight", default=()
    )
    weights: IntArray = about("partition weights a_i of the chosen chromosome", "gene", brief=False)
    base: str = about("none or rigid-body")
    ridge_weight: float = about("chosen; infinite means the fuzzy part is off", gaps=True)
    singular_values: Array = about(
        "of the regressor of the parameters in use, without penalty", "singular_value", unit="SI", brief=False
    )
    rank: int = about("numerical rank")
    condition_number: float = about("over the kept singular values", least=1.0)
    parameters: int = about("number of linear parameters in use")
    rules: RuleExcitation = part()
    pareto_front: Front = part()
    history: History = part()
    stop_reason: StopReason = about("why the search ended: generations, converged, time-limit or interrupted")
    judged: Judged = part()
    rigid_body: Array = about("six inertia parameters of the rigid body that fits best", "6", unit="kg m^2", frame=BODY)
    constant_inertia: Array = about("J11 J22 J33 J12 J13 J23, constant", "6", unit="kg m^2", frame=EULER)
    ridge: RidgeCurve | None = part(default=None)
    """How the ridge weight was chosen, over a rigid body."""
    training_indices: IntArray = about("samples of the flights that trained", "sample", brief=False)
    not_positive_definite: int = about("training samples at which D(q) is not positive definite")
    findings: tuple[str, ...] = about("what failed or was not excited, in words", "finding")
    structures: StructureComparison | None = part(default=None)
    residuals: ResidualAnalysis | None = part(default=None)
    uncertainty: Draws | None = part(default=None)
    curves: Curves | None = part(default=None)
    round_trip: RoundTrip | None = part(default=None)
    steps: StepErrors | None = part(default=None)
    physics: Physics | None = part(default=None)
    verdict: Verdict | None = part(default=None)

    @property
    def functions(self) -> InertiaFunctions:
        """Its inertia functions."""
        functions = self.model.fuzzy
        assert isinstance(functions, InertiaFunctions), "what is identified"
        return functions

    @property
    def complete(self) -> bool:
        """Whether the search came to its end."""
        return is_end(self.stop_reason)

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return "" if self.complete else self.stop_reason

    @property
    def searched(self) -> bool:
        """Whether it has partitions to search for; without, one chromosome was evaluated."""
        return bool(np.size(self.weights))

    @property
    def on_rigid_body(self) -> bool:
        """Whether a rigid body lies under the fuzzy part."""
        return self.base == "rigid-body"

    @property
    def fuzzy_part_off(self) -> bool:
        """Whether cross-validation switched the fuzzy part off."""
        return bool(np.isinf(self.ridge_weight))

    @property
    def known_everywhere(self) -> bool:
        """Whether its one rule is known well enough to hold at attitudes that training did not visit."""
        full = self.rank == self.parameters
        return self.functions.same_everywhere and full and self.condition_number <= WELL_CONDITIONED

    @property
    def trust(self) -> str:
        """How far to trust it by its verdict, a word of `Trust`; of a file by a newer program possibly another."""
        return Trust.NOT_JUDGED if self.verdict is None else self.verdict.label

    @property
    def validated(self) -> bool:
        """Whether any evidence was gathered for it."""
        return self.verdict is not None

    @property
    def generations(self) -> int:
        """Generations that were bred."""
        return len(self.history.evaluations) - 1

    @property
    def evaluations(self) -> int:
        """Chromosomes that were evaluated."""
        return int(self.history.evaluations[-1])

    @property
    def front(self) -> int:
        """Members of the Pareto front."""
        return len(self.pareto_front.objectives)

    @property
    def choice_error(self) -> float | None:
        """Mean squared error on the flights that were kept for the choice; None without any."""
        held_out = self.pareto_front.held_out
        return None if held_out is None else float(np.min(held_out))

    @property
    def samples(self) -> int:
        """Samples of the training part."""
        return self.judged.samples_of(TRAINING)

    @property
    def learned(self) -> int:
        """Samples of it that were learned from."""
        return len(self.training_indices)

    @property
    def fuzzy_part(self) -> str:
        """Whether the fuzzy part is on or off."""
        return "off" if self.fuzzy_part_off else "on"

    @property
    def inertia_kg_m2(self) -> dict[str, dict[str, float]]:
        """The rigid body that fits best, and the one that the config states."""
        stated = six_parameters(self.model.vehicle.inertia_kg_m2)
        found = {"found": self.rigid_body, "stated": stated}
        return {name: dict(zip(INERTIA_PARAMETERS, each.tolist(), strict=True)) for name, each in found.items()}

    @property
    def errors(self) -> dict[str, Any]:
        """Scores on the training part."""
        return self.judged.summary_of(MODEL, TRAINING)

    @property
    def baselines(self) -> dict[str, Any]:
        """Scores of its baselines there."""
        return {name: self.judged.summary_of(name, TRAINING) for name in self.judged.baselines}

    @property
    def held_out(self) -> dict[str, Any]:
        """Scores on what was not learned from, by part, with those of its baselines."""
        judged = self.judged
        return {
            part: {
                **judged.summary_of(MODEL, part),
                "samples": judged.samples_of(part),
                "outside": int(judged.outside[judged.parts.index(part)]),
                "baselines": {name: judged.summary_of(name, part) for name in judged.baselines},
            }
            for part in judged.held_out
        }


def identified_model(
    found: Identification,
    base: str,
    indices: IntArray,
    evidence: Validation | None,
    model: VehicleModel,
    learned_from: tuple[LearnedFlight, ...],
    kept_for_choice: tuple[str, ...],
) -> IdentifiedModel:
    """Put together what an identification found and the evidence on it.

    Parameters
    ----------
    indices : array of int, shape (sample,)
        Samples that trained.
    model : VehicleModel
        The stated vehicle with the inertia that was found.
    """
    baselines = {baseline.name: baseline.parameters for baseline in found.baselines}
    held = {} if evidence is None else vars(evidence)
    return IdentifiedModel(
        model=model,
        learned_from=learned_from,
        kept_for_choice=kept_for_choice,
        weights=found.front.chromosomes[found.front.chosen],
        base=base,
        ridge_weight=found.fit.ridge_weight,
        singular_values=found.system.singular_values,
        rank=found.system.rank,
        condition_number=found.system.condition_number,
        parameters=found.system.parameters,
        rules=found.excitation,
        pareto_front=found.front,
        history=found.history,
        stop_reason=found.stop_reason,
        judged=Judged.of(found),
        rigid_body=baselines["rigid-body"],
        constant_inertia=baselines["constant-inertia"],
        ridge=found.ridge,
        training_indices=indices,
        not_positive_definite=found.indefinite,
        findings=found.findings,
        **held,
    )


def require_whole(path: object, functions: InertiaFunctions) -> None:
    """Refuse inertia functions whose numbers are not those of their structure."""
    peaks = [len(each) for each in functions.partitions]
    wanted = [each.functions for each in functions.structure.partitions]
    if peaks != wanted or len(functions.coefficients) != functions.structure.parameters:
        raise InputError(
            f"{path}: model/fuzzy holds {peaks} breakpoints and {len(functions.coefficients)} coefficients; its "
            f"structure needs {wanted} and {functions.structure.parameters}"
        )
