"""Which blocks are chosen: those that were flown, whatever else is tried."""

from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.playback import structure
from cpfls_cli.playback.fit import WindowSet, WindowSums, fit, parts_of
from cpfls_cli.playback.flight import motion_at
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import Rules, blocks_of
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import SearchStoppedError, Structure, choose, tried_blocks
from cpfls_cli.playback.windows import Loss
from cpfls_cli.search import KeptStructure
from tests.builders.playback_flights import MIDDLING, STATED, TRUE_BLOCKS, flown, truth

TRIED = ("linear_damping", "rotor_drag", "flapping_moment", "quadratic_damping", "inertia")
QUICK = PlaybackSettings(
    search_windows=20, folds=2, leave_out=tuple(block for block in blocks_of(STATED) if block not in TRIED)
)


@pytest.fixture(scope="module")
def flights():
    return flown(truth(), ("figure", "steps"), duration_s=5.0, noise=MIDDLING, seed=2)


def chosen(flights, progress=lambda *_: None, kept=None, settings=QUICK):
    return choose(STATED, flights, settings, progress, kept or {})


def stopping_at(number):
    def progress(judged, _):
        if len(judged) == number:
            raise SearchStoppedError

    return progress


def test_a_stopped_search_gives_what_it_has_and_lacks_baselines_that_were_not_judged(flights):
    choice = chosen(flights, stopping_at(4))
    assert (choice.complete, choice.evaluated) == (False, 4)
    assert choice.best.error <= choice.chosen.error < choice.nothing.error
    choice = chosen(flights, stopping_at(2))
    assert (choice.added, choice.everything) == (None, None)
    assert {each.name for each in choice.tried} == {"chosen", "best", "nothing", "front"}


@pytest.fixture(scope="module")
def searched(flights):
    """Search to the end: what was chosen, and what was told on the way."""
    result = []
    return chosen(flights, lambda judged, total: result.append((judged, total))), result


def test_a_search_shows_how_far_it_is(searched):
    choice, result = searched
    assert choice.complete
    assert [len(judged) for judged, _ in result] == list(range(1, choice.evaluated + 1))
    assert all(len(judged) <= total for judged, total in result)
    assert min(each.error for each in result[-1][0]) == choice.best.error
    assert choice.chosen.numbers <= choice.best.numbers
    assert "flapping_moment" in choice.chosen.structure.blocks
    assert choice.chosen.error < 0.3 * choice.nothing.error


@pytest.mark.parametrize("quick", [False, True])
def test_a_first_answer_grows_from_one_start(flights, quick):
    """It adds a response of the rotors as it adds other blocks; a whole search begins with each of them alone."""
    result = []
    choice = chosen(
        flights,
        lambda judged, _: result.append(judged[-1].structure.blocks),
        settings=replace(QUICK, leave_out=tuple(set(QUICK.leave_out) - {"lag", "slow_actuation"}), quick=quick),
    )
    starts = {("lag",), ("slow_actuation",)}
    assert starts.isdisjoint(result) if quick else starts <= {*result}
    assert "lag" in choice.chosen.structure.blocks


@pytest.mark.parametrize("tried", [(), ("rotor_drag",)])
def test_a_search_among_hardly_anything_comes_to_its_end(flights, tried):
    choice = chosen(flights, settings=replace(QUICK, leave_out=tuple(set(blocks_of(STATED)) - set(tried))))
    assert choice.complete
    assert set(choice.everything.structure.blocks) == set(tried)


@pytest.mark.parametrize("number", [1, 7])
def test_a_search_goes_on_from_what_was_kept(flights, searched, number):
    """Nothing is judged twice, and every fit starts from where it would have started."""
    parts = []

    def stopping(judged, _):
        parts.append(judged)
        if len(judged) == number:
            raise SearchStoppedError

    without, result = searched
    with suppress(SearchStoppedError):
        chosen(flights, stopping)
    kept = dict(KeptStructure.of(each).pair for each in parts[-1])
    resumed = chosen(flights, lambda judged, _: parts.append(judged), kept)
    assert [len(judged) for judged in parts] == list(range(1, without.evaluated + 1))
    pairs = list(zip(result[-1][0], parts[-1], strict=True))
    assert [one.structure for one, _ in pairs] == [other.structure for _, other in pairs]
    assert all(a.error == b.error and np.array_equal(a.by_block, b.by_block) for a, b in pairs)
    assert resumed.chosen.structure == without.chosen.structure
    assert resumed.complete


def test_a_search_finds_what_fits_of_all_structures_find(flights, searched):
    """All 32 structures of these blocks are fitted: the best and the choice among them are those of the search."""
    choice, _ = searched
    bench = structure._Bench(STATED, parts_of(flights, QUICK), lambda *_: None, 1, {}, structure._ACTUATION)
    bench.known.update({each.structure: each for each in (choice.chosen, choice.best)})
    order = tried_blocks(STATED, flights, QUICK)
    for count in range(len(order) + 1):
        for blocks in combinations(order, count):
            bench.judge(Structure(blocks))
    _, best, chosen = structure._preferred(bench)
    assert len(bench.known) == 2 ** len(TRIED) > 2 * choice.evaluated
    assert choice.chosen.structure == chosen.structure
    assert choice.best.error == pytest.approx(best.error, rel=0.01)


def test_errors_are_predicted_near_a_fit(flights):
    """A block less, and one more: fitted, both come to what was predicted from the fit between them."""
    bench = structure._Bench(STATED, parts_of(flights, QUICK), lambda *_: None, 1, {}, structure._ACTUATION)
    base = ("inertia", "thrust_factor", "lag", "linear_damping", "rotor_drag", "flapping_moment")
    outlook = bench.outlook(bench.judge(Structure(base)), ("drag_factor",))
    for blocks in (base[:4] + base[5:], (*base, "drag_factor")):
        fitted = bench.judge(Structure(blocks))
        assert outlook.errors(blocks) == pytest.approx(fitted.by_block, rel=0.2)
        assert outlook.errors(blocks).mean() == pytest.approx(fitted.by_block.mean(), rel=0.05)
        values = fitted.fit.free.values(outlook.start(blocks))
        assert values == pytest.approx(fitted.fit.values, rel=0.1, abs=0.1 * fitted.fit.free.scales.max())


def test_a_fit_predicts_structures_of_fewer_blocks_by_its_own_derivatives(flights, monkeypatch):
    bench = structure._Bench(STATED, parts_of(flights, QUICK), lambda *_: None, 1, {}, structure._ACTUATION)
    judged = bench.judge(Structure(("thrust_factor", "linear_damping", "rotor_drag")))
    monkeypatch.setattr(WindowSet, "derivatives", None)
    monkeypatch.setattr(WindowSet, "errors", None)
    assert bench.outlook(judged, ()).errors(judged.structure.blocks).mean() == pytest.approx(judged.error, rel=0.05)


@pytest.fixture(scope="module")
def learned(flights):
    """A bench that has judged a model with a learned force."""
    bench = structure._Bench(STATED, parts_of(flights, QUICK), lambda *_: None, 1, {}, structure._ACTUATION)
    blocks = ("inertia", "thrust_factor", "lag", "linear_damping", "flapping_moment", "remainder_force")
    return bench, bench.judge(Structure(blocks))


@pytest.mark.parametrize("rules", [Rules(1, 3), Rules(3, 1)])
def test_other_rules_begin_with_what_was_learned(learned, rules):
    bench, judged = learned
    other = judged.structure._replace(rules=rules)
    free = other.free(STATED)
    found = WindowSums(free, bench.windows, free.values(judged.start(other))).errors
    for before, after in zip(bench.windows.errors(judged.fit.free, judged.fit.values), found, strict=True):
        assert after == pytest.approx(before, rel=1e-9)


def test_rules_that_are_predicted_to_be_no_better_are_not_fitted(learned, monkeypatch):
    bench, judged = learned
    tried = []
    monkeypatch.setattr(bench, "judge", lambda each, *_, **__: tried.append(each))
    structure._judge_other(bench, judged, judged.structure.blocks)
    other = [each for each in tried if each.rules != judged.structure.rules]
    assert 0 < len(other) <= structure._FITTED < len(structure.REMAINDERS)


class Bench:
    """Knows the error of each structure, its blocks one letter each, with noise that no comparison sees through."""

    stays, vehicle, responses = 1.0, STATED, structure._ACTUATION

    def __init__(self, errors):
        self.errors, self.known = errors, {}

    def judge(self, tried, *_, first=None):  # noqa: ARG002
        error, count = self.errors["".join(tried.blocks)], len(tried.blocks)
        fit = SimpleNamespace(free=SimpleNamespace(named=lambda _: {}), values=None)
        judged = structure.Judged(tried, error, self.by_block(tried.blocks), count, 1.0, fit, ())
        return self.known.setdefault(tried, judged)

    def by_block(self, blocks):
        return self.errors["".join(blocks)] + 0.002 * (-1) ** len(blocks) * np.array([-1.0, 1.0])

    def judge_from(self, near, tried, outlook):  # noqa: ARG002
        return self.judge(tried)

    def outlook(self, near, blocks):  # noqa: ARG002
        return SimpleNamespace(errors=self.by_block, start=lambda _: {})

    def outlooks(self, near, others):
        return {each: self.outlook(near, each.blocks) for each in others}


def test_no_block_can_be_left_out_of_the_choice():
    bench = Bench({"": 1.0, "a": 0.3, "b": 0.4, "c": 0.9, "ab": 0.1004, "ac": 0.3, "bc": 0.4, "abc": 0.1})
    bench.judge(Structure(("a", "b", "c")))
    structure._settle(bench, ("a", "b", "c"))
    assert structure._preferred(bench)[2].structure.blocks == ("a", "b")


def test_blocks_that_gain_only_together_are_found_from_all():
    bench = Bench({"": 1.0, "a": 0.5, "b": 1.0, "c": 0.98, "ab": 0.51, "ac": 0.52, "bc": 0.97, "abc": 0.1})
    assert structure._grow(bench, ("a", "b", "c")).structure.blocks == ("a",)
    structure._explore(bench, bench.judge(Structure(("a", "b", "c"))), ("a", "b", "c"))
    structure._settle(bench, ("a", "b", "c"))
    assert structure._preferred(bench)[2].structure.blocks == ("a", "b", "c")


@pytest.mark.parametrize(
    ("errors", "chosen"),
    [
        pytest.param({"a": 0.0115, "ab": 0.0101, "abc": 0.01}, "ab", id="of what is left, where little is"),
        pytest.param({"a": 0.505, "ab": 0.501, "abc": 0.5}, "ab", id="of what there is to predict, where much is"),
    ],
)
def test_what_is_significant_and_not_visible_is_worth_no_number(errors, chosen):
    bench = Bench(errors)
    for blocks in errors:
        bench.judge(Structure(tuple(blocks)))
    assert structure._preferred(bench)[2].structure.blocks == tuple(chosen)


def test_flights_of_one_axis_each_are_cut(flights):
    """No model can be asked for an axis that nothing has shown it."""

    def turning(axis):
        motion = flights[0].motion
        rate = 0.1 * motion.rate
        rate[:, axis] *= 100.0
        return replace(flights[0], motion=motion._replace(rate=rate), name=f"about {axis}")

    parts = parts_of([turning(0), turning(1)], QUICK)
    assert [[windows.flight.name for windows in part] for part in parts] == [["about 0", "about 1"]] * 2
    for first, second in zip(*parts, strict=True):
        assert first.starts[-1] + first.horizon < second.starts[0]


def test_flights_that_can_be_parted_and_judged_are_asked_for_what_they_show(flights):
    still = [replace(flight, has_velocity=False) for flight in flights]
    assert set(tried_blocks(STATED, flights, QUICK)) == set(TRIED)
    assert set(tried_blocks(STATED, still, QUICK)) == {"linear_damping", "quadratic_damping", "inertia"}
    every, commands = replace(QUICK, leave_out=()), [replace(flight, commanded=True) for flight in flights]
    assert {*tried_blocks(STATED, commands, every)} - {*tried_blocks(STATED, flights, every)} == {"thrust_slope"}
    parts = parts_of(flights, QUICK)
    assert [[windows.flight.name for windows in part] for part in parts] == [[each.name] for each in flights]
    first, second = (part[0].starts for part in parts_of(flights[:1], QUICK))
    assert first[-1] + 50 < second[0]


def test_flights_that_show_nothing_to_judge_by_are_refused(flights):
    motion, speed = flights[0].motion, flights[0].speed
    short = replace(flights[0], motion=motion_at(motion, slice(55)), speed=speed[:55], stretches=(slice(0, 55),))
    with pytest.raises(InputError, match=r"figure-2-0: too short for a horizon of 0\.5 s to be judged"):
        parts_of([short], QUICK)
    motion = flights[0].motion
    unseen = replace(flights[0], motion=motion._replace(rate=0.0 * motion.rate), has_attitude=False)
    with pytest.raises(InputError, match="figure-2-0: no body rate changes, and no attitude was measured"):
        parts_of([unseen, flights[1]], QUICK)


def test_flights_that_are_logged_fast_are_flown_in_steps_of_several_samples():
    """Structures are compared by them, with nearly the same errors."""
    fast = flown(truth(), ("figure", "steps"), duration_s=5.0, rate_hz=500.0, noise=MIDDLING, seed=2)
    windows = [each for part in parts_of(fast, QUICK) for each in part]
    assert [each.every for each in windows] == [5, 5]
    found = fit(Structure(TRUE_BLOCKS).free(STATED), windows, {}, 12, 1e-3)

    def of_all_samples(each):
        # Errors count at the ends of the longer steps alone.
        weight, delta = (np.repeat(one, 5, axis=0) for one in each.loss)
        weight[np.arange(len(weight)) % 5 != 4] = 0.0
        return replace(each, loss=Loss(weight, delta), every=1)

    sets = (WindowSet(tuple(own)) for own in (windows, map(of_all_samples, windows)))
    coarse, fine = (own.errors(found.free, found.values) for own in sets)
    assert np.concatenate(coarse) == pytest.approx(np.concatenate(fine), rel=0.05)
    assert np.concatenate(coarse).mean() == pytest.approx(np.concatenate(fine).mean(), rel=0.005)


def test_a_lag_and_a_delay_are_not_a_slow_part_that_overshoots():
    """A share above 1 of a slow part answers against the command first, as a delay seems to."""
    late = VehicleModel(vehicle=STATED, response=RotorResponse(lag_s=0.03, delay_s=0.03))
    tried = ("lag", "delay", "slow_actuation")
    left_out = tuple(block for block in blocks_of(STATED) if block not in tried)
    found = chosen(
        flown(late, ("figure", "steps"), duration_s=6.0, noise=MIDDLING, seed=1),
        settings=replace(QUICK, leave_out=left_out),
    ).chosen
    values = found.fit.free.named(found.fit.values)
    assert found.structure.blocks == ("lag", "delay")
    assert values["lag.time_constant_s"] == pytest.approx(0.03, abs=0.004)
    assert values["delay.delay_s"] == pytest.approx(0.03, abs=0.004)
