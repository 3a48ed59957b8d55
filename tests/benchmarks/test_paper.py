"""Claims of the paper, and figures next to them."""

import statistics
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from benchmarks.paper.beside import printed_beside
from benchmarks.paper.claims import (
    CONTINUITY_CLAIM,
    CONTRIBUTION_CLAIM,
    DECOMPOSITION_TIME_CLAIM,
    EVALUATION_TIME_CLAIM,
    FLOOR_CLAIM,
    RELATIVE_ERROR_CLAIM,
    ClaimVerdict,
    EvaluationTime,
    PaperSources,
)
from benchmarks.paper.printed import TABLE_5
from benchmarks.paper.readings import readings, readings_blocks, readings_figure
from benchmarks.paper.replicates import Sweep, spread
from benchmarks.paper.reproduction import CLAIMS, partitions_compared, seesaw_compared
from benchmarks.paper.search_claims import (
    AS_GOOD,
    CLASSIC_CLAIM,
    CONVERGENCE_CLAIM,
    RANKING_CLAIM,
    REDUCED_CLAIMS,
    SMALLER_SEARCH_CLAIM,
    TYPICAL_CONDITION_CLAIM,
    TYPICAL_ERRORS_CLAIM,
    paired_ratio,
)
from cpfls_cli.config.study import ReportSettings
from cpfls_cli.reduction.training_set import Selection
from cpfls_cli.report.source import Source
from cpfls_cli.result import plain
from cpfls_cli.simulation.model import Noise, Simulated
from cpfls_cli.store import Origin
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.sweeps import setting_of, sweep_of

NOISE = np.exp(np.random.default_rng(3).normal(0.0, 0.4, 10))
"""What a seed does to all settings alike."""
FULL = replace(setting_of(NOISE, size=(20, 5)), uniform_condition_number=100.0, largest_torque=1.9)
VALUES = [0.0012, 0.0009, 0.0031, 0.0010]


def sources(*records, times=()):
    """A report about records."""
    given = [Source("s.h5", "", record, {}, None, 0, header=Origin(stage="reduce")) for record in records]
    sweeps = [source for source in given if isinstance(source.record, Sweep)]
    others = [source for source in given if source not in sweeps]
    return PaperSources(others, VehicleSettings(), ReportSettings(), times, sweeps)


def with_runs(setting, **values):
    """Give the runs of a setting other numbers: one for all of them, or one for each."""
    each = {name: np.broadcast_to(value, len(setting.replicates)).tolist() for name, value in values.items()}
    errors = ("mse", "max_error", "relative_error")
    runs = [
        replace(run, **{name: np.array([own[at]]) if name in errors else own[at] for name, own in each.items()})
        for at, run in enumerate(setting.replicates)
    ]
    return replace(setting, replicates=tuple(runs))


def measured(*sweeps):
    """Measurements by number: 2743, 1170 and 685 samples, the smaller search, the classic system."""
    given = sources(*sweeps)
    return [claim.measure(given) for claim in (*REDUCED_CLAIMS, SMALLER_SEARCH_CLAIM, CLASSIC_CLAIM)]


def claims(*settings):
    return [measurement.verdict for measurement in measured(*([sweep_of(*settings)] if settings else []))]


def test_a_ratio_is_that_of_a_t_test_on_logarithms_of_pairs():
    rng = np.random.default_rng(8)
    one, other = np.exp(rng.normal(0.3, 0.5, (2, 9)))
    shuffled = rng.permutation(9)
    found = paired_ratio(setting_of(one), setting_of(other[shuffled], seeds=shuffled))
    test = stats.ttest_1samp(np.log(one / other), 0.0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((np.exp(test.low), np.exp(test.high)))
    assert found.ratio == pytest.approx(stats.gmean(one) / stats.gmean(other))
    assert found.p_value == pytest.approx(stats.wilcoxon(one, other).pvalue, abs=0.05)


def test_only_seeds_of_both_are_paired():
    found = paired_ratio(setting_of([2.0, 4.0, 8.0], seeds=[1, 2, 3]), setting_of([9.0, 2.0, np.nan], seeds=[5, 2, 3]))
    assert (found.seeds, found.failed, found.reference_failed, found.ratio) == (2, 0, 1, 2.0)
    assert np.isnan(found.low)
    assert paired_ratio(setting_of([1.0]), setting_of([1.0], seeds=[7])).seeds == 0


@pytest.mark.parametrize("failed", [[4], [1, 2, 3, 4, 5, 6, 7]])
def test_a_seed_without_a_model_is_a_failure_of_its_setting_of(failed):
    """Left out, it would let a setting pass that fails often."""
    lost = NOISE.copy()
    lost[failed] = np.nan
    found = paired_ratio(setting_of(lost), setting_of(NOISE))
    assert (found.seeds, found.failed, found.ratio, found.low) == (10, len(failed), np.inf, np.inf)
    own = measured(sweep_of(setting_of(NOISE), setting_of(lost, samples=685)))[2]
    assert (own.verdict, own.ours) == (ClaimVerdict.FAIL, f"no model for {len(failed)} of 10 seeds")
    beside = measured(sweep_of(setting_of(lost), setting_of(NOISE, samples=685)))[2]
    assert f"No model in {len(failed)} of them with the one beside it" in beside.why


def test_a_seed_without_a_model_in_both_is_said_and_decides_nothing():
    lost = np.where(np.arange(10) == 4, np.nan, NOISE)
    judged = measured(sweep_of(setting_of(lost), setting_of(lost, samples=685)))[2]
    assert judged.verdict == ClaimVerdict.PASS
    assert "No model in 1 of them with this setting." in judged.why


def test_the_margin_is_the_largest_that_the_paper_prints_and_calls_no_difference():
    assert pytest.approx(12 / 9) == AS_GOOD


@pytest.mark.parametrize(
    ("factor", "scatter", "verdict"),
    [
        (1.1, 0.05, ClaimVerdict.PASS),
        (0.5, 0.05, ClaimVerdict.PASS),
        (2.0, 0.05, ClaimVerdict.FAIL),
        (1.3, 0.3, ClaimVerdict.UNDECIDED),
    ],
)
def test_reduced_sets_against_the_full_one(factor, scatter, verdict):
    own = np.exp(scatter * np.array([1, -1, 1, -1, 1, -1, 1, -1, 1, -1]))
    reduced = [setting_of(factor * NOISE * own, samples=samples) for samples in (2743, 1170, 685)]
    assert claims(setting_of(NOISE), *reduced)[:3] == [verdict] * 3


def test_one_seed_decides_nothing_and_unequal_searches_are_not_compared():
    assert claims(setting_of([1.0]), setting_of([9.0], samples=685))[2] == ClaimVerdict.UNDECIDED
    assert claims(setting_of(NOISE), setting_of(NOISE, samples=685, size=(75, 25)))[2] == ClaimVerdict.NOT_MEASURED
    assert claims() == [ClaimVerdict.NOT_MEASURED] * 5


def test_a_smaller_search_needs_a_much_larger_one_next_to_it():
    small = setting_of(1.05 * NOISE, samples=685, size=(75, 25))
    assert claims(small, setting_of(NOISE, samples=685, size=(40, 10)))[3] == ClaimVerdict.NOT_MEASURED
    assert claims(small, setting_of(NOISE, samples=685, size=(500, 200)))[3] == ClaimVerdict.PASS
    assert claims(small, setting_of(NOISE / 3, samples=685, size=(500, 200)))[3] == ClaimVerdict.FAIL
    assert claims(small, setting_of(NOISE, samples=1170, size=(500, 200)))[3] == ClaimVerdict.NOT_MEASURED


def test_the_periodic_system_against_the_classic_one():
    assert claims(setting_of(3 * NOISE), setting_of(NOISE, "fls"))[4] == ClaimVerdict.FAIL
    assert claims(setting_of(NOISE), setting_of(3 * NOISE, "fls"))[4] == ClaimVerdict.PASS


def test_the_larger_search_decides():
    small, large = (
        sweep_of(setting_of(factor * NOISE, size=size), setting_of(NOISE, "fls", size=size))
        for factor, size in ((3.0, (40, 10)), (1.0, (500, 200)))
    )
    assert [measured(*order)[4].verdict for order in ([small, large], [large, small])] == [ClaimVerdict.PASS] * 2


def times(evaluation, svd=lambda n: 1e-5 * n):
    return [
        EvaluationTime(samples=n, svd_s=svd(n), evaluation_s=evaluation(n), compiled_s=1e-3)
        for n in (343, 685, 1170, 2743, 5487)
    ]


def timing_claims(given):
    about = sources(times=given)
    return [claim.measure(about) for claim in (EVALUATION_TIME_CLAIM, DECOMPOSITION_TIME_CLAIM)]


def test_time_in_proportion_to_the_decomposition():
    assert [c.verdict for c in timing_claims(times(lambda n: 3e-5 * n))] == [ClaimVerdict.PASS, ClaimVerdict.FAIL]
    assert timing_claims(times(lambda n: 1e-2 + 1e-5 * n))[0].verdict == ClaimVerdict.FAIL
    assert timing_claims(times(lambda n: 1e-9 * n**2))[0].verdict == ClaimVerdict.FAIL
    assert timing_claims(times(lambda n: 1e-5 * n, lambda n: np.exp(n / 1e3)))[1].verdict == ClaimVerdict.PASS
    assert [c.verdict for c in timing_claims(())] == [ClaimVerdict.NOT_MEASURED] * 2


def selection(kept, condition, trace, rank=9):
    values = np.array(trace, dtype=float)
    return Selection(
        indices=np.arange(kept),
        condition_number_trace=values,
        singular_value_min_trace=values,
        singular_value_max_trace=values,
        rank_trace=np.full(len(values), rank),
        rank=rank,
        rank_full=9,
        condition_number=condition,
        condition_number_full=100.0,
        candidates=100,
        criterion="D",
        stop_reason="size",
        random=np.array([400.0]),
    )


def reduction_claims(selections):
    given = sources(*selections)
    return [claim.measure(given) for claim in (CONTRIBUTION_CLAIM, FLOOR_CLAIM)]


def test_what_a_fifth_of_the_samples_keeps():
    contribution, floor = reduction_claims([selection(19, 124.0, [np.inf, 120, 130, 124.9, 124])])
    assert (contribution.verdict, floor.verdict) == (ClaimVerdict.PASS, ClaimVerdict.PASS)
    assert "4 samples (4.0 %) already keep 80 %" in contribution.why
    assert "keeps 25.0 %" in contribution.why
    contribution, floor = reduction_claims([selection(19, 126.0, [126]), selection(50, 99.0, [99])])
    assert (contribution.verdict, floor.verdict) == (ClaimVerdict.FAIL, ClaimVerdict.FAIL)
    assert reduction_claims([selection(19, 7.0, [7], rank=8)])[0].verdict == ClaimVerdict.FAIL
    assert reduction_claims([selection(20, 100.0, [100])])[0].verdict == ClaimVerdict.NOT_MEASURED


def test_the_printed_numbers_are_read_as_the_paper_means_them():
    """They are held against a decoder: no model, good or bad, has a part in it."""
    assert seesaw_compared().agreement == "read as printed"
    assert partitions_compared().agreement == "read as printed"
    for figure in (seesaw_compared(), partitions_compared()):
        assert "how the paper is read, not of any model" in figure.why


def verdict(claim, *settings):
    return claim.of_searches([settings]).verdict


@pytest.mark.parametrize(
    ("mse", "largest", "torque", "expected"),
    [
        (9e-4, 0.19, 1.6, ClaimVerdict.PASS),
        (1.1e-3, 0.19, 1.6, ClaimVerdict.FAIL),
        (9e-4, 0.21, 1.6, ClaimVerdict.FAIL),
        (9e-9, 0.01, 0.06, ClaimVerdict.UNDECIDED),
        (np.nan, np.nan, 1.6, ClaimVerdict.FAIL),
    ],
)
def test_typical_errors_need_torques_that_are_larger(mse, largest, torque, expected):
    """Where no torque reaches 0.2 N m, a model of nothing passes too."""
    ours = replace(with_runs(setting_of([mse] * 3), max_error=largest), largest_torque=torque)
    assert verdict(TYPICAL_ERRORS_CLAIM, ours) == expected


@pytest.mark.parametrize(("condition", "passes"), [(2600, False), (2800, True), (7300, True), (7400, False)])
def test_a_typical_condition_number_lies_between_those_of_the_table(condition, passes):
    ours = with_runs(setting_of(NOISE), condition_number=float(condition))
    assert (verdict(TYPICAL_CONDITION_CLAIM, ours) == ClaimVerdict.PASS) == passes
    classic = with_runs(setting_of(NOISE, "fls"), condition_number=1e9)
    assert verdict(TYPICAL_CONDITION_CLAIM, ours, classic) == verdict(TYPICAL_CONDITION_CLAIM, ours)


def test_a_search_has_converged_where_its_last_fifth_brings_nothing():
    small, large = setting_of(NOISE, size=(75, 25)), setting_of(NOISE, size=(500, 200))
    early = [with_runs(s, settled=generation) for s, generation in ((small, 20), (large, 160))]
    assert verdict(CONVERGENCE_CLAIM, *early) == ClaimVerdict.PASS
    assert verdict(CONVERGENCE_CLAIM, with_runs(small, settled=21), early[1]) == ClaimVerdict.FAIL
    assert verdict(CONVERGENCE_CLAIM, setting_of(NOISE)) == ClaimVerdict.NOT_MEASURED
    assert "The random start is there already" in CONVERGENCE_CLAIM.of_searches([[with_runs(small, settled=0)]]).why


def test_ranking_by_quantity_next_to_a_classical_one():
    quantity, pareto = setting_of(NOISE, samples=685), replace(setting_of(NOISE, samples=685), ranking="pareto-fronts")
    assert verdict(RANKING_CLAIM, quantity, pareto) == ClaimVerdict.PASS
    assert verdict(RANKING_CLAIM, with_runs(quantity, mse=2 * quantity.of("mse")), pareto) == ClaimVerdict.FAIL
    assert verdict(RANKING_CLAIM, quantity, replace(pareto, samples=1170)) == ClaimVerdict.NOT_MEASURED
    assert verdict(RANKING_CLAIM, quantity, replace(quantity, population=75)) == ClaimVerdict.NOT_MEASURED


@pytest.mark.parametrize(("torque", "passes"), [(np.cos, True), (np.sin, True), (np.asarray, False)])
def test_torque_goes_on_across_a_full_turn(torque, passes):
    functions = SimpleNamespace(torque=lambda motion: torque(motion.attitude))
    record = SimpleNamespace(functions=functions)
    model = SimpleNamespace(record=record, label="m.h5", config={"identification": {"structure": "cpfls"}})
    assert (CONTINUITY_CLAIM.measure(SimpleNamespace(models=[model])).verdict == ClaimVerdict.PASS) == passes
    assert CONTINUITY_CLAIM.measure(SimpleNamespace(models=[])).verdict == ClaimVerdict.NOT_MEASURED


def chosen(criterion, judged_on, factor, condition, size=(20, 5)):
    ours = setting_of(factor * NOISE, samples=685, size=size)
    ours = with_runs(ours, **{f"learned_{name}": 0.1 * NOISE for name in ("mse", "max_error", "relative_error")})
    return replace(ours, uniform_condition_number=condition, criterion=criterion, judged_on=judged_on)


def reading_sources(*flights):
    """Sweeps over readings: noise of the torque, and the settings."""
    path = {"path": "p", "legs": 3, "displacement_m": 64.0, "period_s": 1.0}
    made = [
        SimpleNamespace(
            label="s.h5",
            config={"trajectory": path, "simulation": {"relative_noise": {"torque": noise} if noise else {}}},
            record=SimpleNamespace(settings=settings, joined=lambda _: None),
            header=SimpleNamespace(inputs={}),
            made_from=lambda _: "flown",
        )
        for noise, settings in flights
    ]
    std = {"body_rate": np.full(3, 9.0), "torque": np.array([0.01, 0.02, 0.03])}
    noise = {name: Noise(std=each) for name, each in std.items()}
    flight = SimpleNamespace(record=Simulated(time=np.arange(3.0), noise_std=noise, infeasible=(), effects={}))
    return SimpleNamespace(sweeps=made, by_hash=lambda _: flight)


def test_every_reading_is_judged_on_its_own_samples_and_errors():
    settings = [FULL, chosen("even", "training", 1.0, 101.0), chosen("D", "training", 9.0, 60.0)]
    found = readings(reading_sources((0.05, [*settings, chosen("D", "learned", 9.0, 60.0)]), (0.0, settings)))
    assert [(r.noise, r.criterion, r.judged_on) for r in found] == [
        (0.0, "even", "training"),
        (0.0, "D", "training"),
        (0.05, "even", "training"),
        (0.05, "D", "training"),
        (0.05, "D", "learned"),
    ]
    reduced = [r.measured([REDUCED_CLAIMS[2]])[0].verdict for r in found[2:]]
    assert reduced == [ClaimVerdict.PASS, ClaimVerdict.FAIL, ClaimVerdict.PASS]
    relative = [r.measured([RELATIVE_ERROR_CLAIM])[0].ours for r in found[3:]]
    assert relative[0] != relative[1]
    reduction = [[m.verdict for m in r.measured([CONTRIBUTION_CLAIM, FLOOR_CLAIM])] for r in found[2:4]]
    assert reduction == [[ClaimVerdict.PASS, ClaimVerdict.PASS], [ClaimVerdict.PASS, ClaimVerdict.FAIL]]


def test_the_flight_that_is_nearest_to_the_printed_numbers_is_named():
    """Ten times the printed mean squared error on the chosen samples of one of two otherwise equal flights."""
    printed = with_runs(FULL, mse=9e-4)
    near, far = ([printed, with_runs(chosen("D", "training", 1.0, 100.0), mse=mse)] for mse in (1.2e-3, 1.2e-2))
    given = reading_sources((0.0, far), (0.05, near))
    answer = [block.text for block in readings_blocks(given, CLAIMS)[0]]
    assert "3 × 64 m at P = 1 s with 5 % noise" in answer[1]
    assert "Its noise alone has a mean square of 0.000467 (N" in answer[2]
    assert "MSE of cpFLS on the fewest (0.0120, printed 0.00120)" in answer[2]
    assert "MSE" not in answer[3]
    far, near = readings(given)
    assert far.factor / near.factor == pytest.approx(10 ** (1 / 8))


def test_of_one_reading_in_two_sweeps_the_larger_search_stands():
    large = [replace(s, population=40) for s in (FULL, chosen("even", "training", 1.0, 101.0))]
    small = [FULL, chosen("even", "training", 1.0, 101.0), chosen("D", "training", 9.0, 60.0)]
    for order in ([(0.0, small), (0.0, large)], [(0.0, large), (0.0, small)]):
        found = {reading.criterion: reading.search for reading in readings(reading_sources(*order))}
        assert found == {"even": "40 × 5", "D": "20 × 5"}


def test_a_report_of_one_reading_compares_none():
    assert readings_blocks(reading_sources((0.0, [FULL, chosen("D", "training", 1.0, 9.0)])), CLAIMS) == ([], [])


@pytest.mark.usefixtures("drawn")
def test_readings_are_drawn_where_a_search_found_nothing_too():
    nothing = chosen("D", "training", np.nan, 60.0)
    given = readings(reading_sources((0.0, [FULL, chosen("even", "training", 1.0, 101.0), nothing])))
    drawn = readings_figure(given).picture.svg
    assert all(name in drawn for name in ("4/3", "even", "no noise"))
    assert np.isfinite([reading.factor for reading in given]).all()


def setting(structure="cpfls", samples=685, population=500, generations=200):
    return setting_of([1.0], structure, samples, (population, generations))


def test_the_papers_own_settings_find_their_columns():
    own = [setting(c.structure, c.samples, c.population, c.generations) for c in TABLE_5]
    assert (printed_beside(own), printed_beside(own[::-1])) == (list(TABLE_5), list(TABLE_5)[::-1])


def test_smaller_searches_take_the_columns_in_order_but_leave_exact_ones():
    small, exact = setting(population=20, generations=5), setting(population=75, generations=25)
    assert printed_beside([small, exact]) == [TABLE_5[4], TABLE_5[5]]
    assert printed_beside([exact, small]) == [TABLE_5[5], TABLE_5[4]]
    assert printed_beside([small, exact, small]) == [TABLE_5[4], TABLE_5[5], None]


def test_other_settings_have_none():
    assert printed_beside([setting(samples=80), setting("fls", 685)]) == [None, None]


def test_mean_and_variance():
    found = spread(np.array(VALUES))
    assert (found.count, found.mean) == (len(VALUES), pytest.approx(statistics.mean(VALUES)))
    assert found.variance == pytest.approx(statistics.variance(VALUES))
    assert found.standard_deviation == pytest.approx(statistics.stdev(VALUES))


def test_what_is_not_known_does_not_count_and_too_few_have_no_spread():
    assert plain(spread(np.array([*VALUES, np.nan, np.inf]))) == plain(spread(np.array(VALUES)))
    one, none = spread(np.array([3.0])), spread(np.array([]))
    assert (one.count, one.mean) == (1, 3.0)
    assert np.isnan([one.variance, one.standard_deviation, none.mean, none.variance]).all()


def test_best_run():
    assert setting_of((3.0, np.nan, 1.0)).best.seed == 2
    assert setting_of((np.nan,)).best is None
