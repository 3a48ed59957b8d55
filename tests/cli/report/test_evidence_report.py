"""Pages of models and of gaps: the verdict first, every figure once."""

import json
import re
import warnings
from dataclasses import replace
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest

import cpfls_cli
from cpfls_cli import store
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement, Extended
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.job import input_file
from cpfls_cli.store import Origin, read
from tests.builders import gap_artifacts as made
from tests.builders.command_line import drawn, run
from tests.builders.evidence_artifacts import REASONS, with_evidence
from tests.builders.identified_models import EVIDENCE_PARTS, write_changed
from tests.builders.studies import VEHICLE

EVIDENCE = ["what it leaves unexplained", "how sure the inertia is", "prediction by horizon"]
FIGURES = [
    f"identify-1-{name}"
    for name in ("autocorrelation", "cross-correlation", "error-distribution", "inertia-curves-1", "inertia-curves-2",
                 "steps")
]  # fmt: skip


@pytest.fixture(scope="module")
def report(cpfls, study, tmp_path_factory):
    def write(*artifacts, form="html"):
        output = tmp_path_factory.mktemp("report") / f"report.{form}"
        result = cpfls.done("report", study, *artifacts, "-o", output, "--json")
        text = output.read_text(encoding="utf-8")
        return SimpleNamespace(text=text, words=words(text), **json.loads(result.stdout))

    return write


def words(html):
    """Give the text of a page in one line."""
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", re.sub(r"<style>.*?</style>", "", html, flags=re.DOTALL))).split())


def section(page, name):
    return words(page.text[page.text.index(f'<section id="{name}"') :].split("</section>")[0])


@pytest.fixture(scope="module")
def model(pipeline, tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    return lambda **changed: with_evidence(
        pipeline.model, folder / f"model-{len(list(folder.iterdir()))}.h5", **changed
    )


@pytest.fixture(scope="module")
def bare(pipeline, tmp_path_factory):
    """A model without any evidence."""
    output = tmp_path_factory.mktemp("bare") / "bare.h5"
    write_changed(pipeline.model, output, **dict.fromkeys((*EVIDENCE_PARTS, "ridge")))
    return output


@pytest.fixture(scope="module")
def page(report, model):
    with drawn(shown=False):
        return report(model())


def test_all_evidence_is_shown(page):
    assert [name for name in EVIDENCE if name in section(page, "identify")] == EVIDENCE
    assert [name for name in page.figures if name in FIGURES] == FIGURES
    assert page.text.count("<summary>Numbers</summary>") == len(page.figures)


def test_a_model_without_evidence_names_the_command_that_adds_it(report, bare):
    page = report(bare)
    assert [name for name in EVIDENCE if name in section(page, "identify")] == []
    assert page.words.count("--set identification.validation.enabled=true") == 1
    assert "NOT JUDGED: bare.h5" in section(page, "summary")


@pytest.mark.parametrize(
    ("label", "short", "answer", "tone"),
    [
        ("good-for-control", "GOOD FOR CONTROL", "Good for control", "good"),
        ("good-inside-region", "GOOD INSIDE ITS REGION", "Good inside the region that training visited", "note"),
        ("not-better-than-rigid-body", "NO BETTER THAN A RIGID BODY", "Not better than the rigid body", "warning"),
        ("do-not-use", "DO NOT USE", "Do not use it", "warning"),
        ("of-a-newer-version", "OF-A-NEWER-VERSION", "Of-a-newer-version", "note"),
    ],
)
def test_the_verdict_comes_first_and_with_its_reasons(report, model, label, short, answer, tone):
    page = report(model(label=label))
    summary, evidence = section(page, "summary"), section(page, "identify")
    assert re.match(
        rf"Summary {short}: model-\d+\.h5: .*{answer}.* Region: roll and pitch within 32 degrees\.", summary
    )
    assert f'<article class="card {tone} open wide">' in page.text
    for sign, reason in zip(("For it", "Against it", "To know"), REASONS, strict=True):
        assert f"{sign}: {reason[0].upper()}{reason[1:]}." in f"{summary} {evidence}"


def test_an_incomplete_search_is_said_in_the_summary(report, model):
    assert "stopped (time limit), go on with" in section(report(model(stop_reason="time-limit")), "summary")
    assert "stopped" not in section(report(model()), "summary")


def test_scores_are_those_of_the_artifact(page, pipeline):
    r2 = read(pipeline.model, IdentifiedModel)[0].judged.of_axes("r2", "model", "training")
    shown = section(page, "identify")
    for explained in r2:
        assert f"{100 * np.sqrt(1 - explained):.3g}" in shown
    assert "not in 3 of 120 cells" in shown
    assert "at roll 12°, pitch −34°" in shown


def test_structures_are_compared_and_the_least_error_is_marked_in_words(page):
    shown = section(page, "identify")
    assert "rigid body 0 0.05000 ± 0.0040 fuzzy part off" in shown
    assert "5 functions | harmonic 60 0.03100 ± 0.0030 ◂ least" in shown
    assert "7 functions (this model)" in shown


@pytest.mark.parametrize(
    ("error", "answer"),
    [
        ((0.9, 0.5, 1.0), "reduces the error of the rigid body by 50.0 %, 5.0 standard errors"),
        ((0.99, 0.95, 1.0), "within one standard error: the flight holds hardly any evidence"),
        ((1.2, 1.1, 1.0), "this flight holds no evidence"),
    ],
)
def test_the_ridge_curve_says_whether_there_is_evidence_for_a_fuzzy_part(report, model, error, answer):
    ridge = {
        "ridge/weight": np.array([1e-3, 1.0, np.inf]),
        "ridge/error": np.array(error),
        "ridge/standard_error": np.full(3, 0.1),
        "ridge/chosen": 1,
    }
    page = report(model(**ridge))
    assert answer in section(page, "identify")
    assert "identify-1-ridge-curve" in page.figures


def test_how_many_samples_of_how_many_were_examined(report, model):
    assert "the first 2500 of its 7300 samples" in section(report(model()), "identify")
    assert "held-out rest, 2500 samples" in section(report(model(**{"residuals/available": 2500})), "identify")


def test_residuals_are_called_white_where_they_are(page):
    shown = section(page, "identify")
    assert re.search(r"roll 0\.700 2\d\.\d % < 10⁻⁶ \S+ 0\.30 not white pitch", shown)
    assert re.search(r"pitch 0\.140 \S+ % 0\.40 0\.1250? < 10⁻⁶ white, not 0 in the mean", shown)
    assert "yaw — — — — — only rounding is left" in shown
    assert re.search(r"roll \+0\.4\d at 0\.0\d ◂", shown)
    assert "a|b <i>" in shown


def test_residuals_that_are_rounding_are_not_drawn(report, model):
    exact = {"residuals/autocorrelation": np.full((40, 3), np.nan), "residuals/ljung_box": np.full(3, np.nan)}
    page = report(model(**exact))
    assert "Nothing but rounding is left over" in section(page, "identify")
    assert not set(FIGURES[:3]) & set(page.figures)


def test_bands_of_the_inertia_stand_next_to_the_stated_values(report, model, pipeline):
    value = read(pipeline.model, IdentifiedModel)[0].rigid_body
    spread = np.tile([-1.0, 1.0], 30)[:, None] * np.array([1.0, 1e-9, 1.0, 1.0, 1.0, 1.0])
    moved = value + np.array([0.0, 1.0, 0, 0, 0, 0])
    drawn = {"uncertainty/best_rigid_body": moved + 0.01 * spread, "rigid_body": moved}
    rows = re.findall(r'<th [^>]*scope="row">(I..)</th>(.*?)</tr>', report(model(**drawn)).text, re.DOTALL)
    last = {name: words(row).split()[-1] for name, row in rows if "inside" in row or "outside" in row}
    assert last["Ixx"] == "inside"
    assert "Iyy" in last
    assert last["Iyy"] == "◂"


def test_the_round_trip_is_said_with_its_share(page, report, model):
    assert "D22 96.0 %, D33 96.0 %, D11 96.0 %" in section(page, "identify")
    without = report(model(**{"round_trip/inertia": None, "round_trip/inside": None}))
    assert "Round trip" not in section(without, "identify")


def test_a_prediction_that_is_lost_is_a_dash_and_the_least_error_is_marked(page):
    shown = section(page, "identify")
    assert re.search(r"rigid body \S+ — nothing moves", shown)
    assert re.search(r"0\.500 s 50 model \S+ ◂ \S+ ◂", shown)


@pytest.mark.parametrize(("condition", "answer"), [(3.0, "one rule holds everywhere"), (1e4, "the model extrapolates")])
def test_one_rule_that_training_determined_holds_everywhere(cpfls, pipeline, study, tmp_path, condition, answer):
    single, known = (tmp_path / f"{name}.h5" for name in ("single", "known"))
    options = ("--set", "identification.membership_functions=1", "--set", "identification.validation.enabled=false")
    cpfls("identify", study, pipeline.flight, "-o", single, *options)
    model = read(single, IdentifiedModel)[0]
    write_changed(
        single,
        known,
        model__fuzzy__visited=np.eye(len(model.functions.visited), dtype=bool),
        rank=model.parameters,
        condition_number=condition,
    )
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always")
        cpfls_cli.load_model(known).predict(pipeline.flight)
    assert any(answer in str(each.message) for each in noted)


GAP_FIGURES = [
    "diagnose-1-free-runs", "diagnose-1-gap-picture", "diagnose-1-gap-sizes", "diagnose-1-playback",
    "diagnose-1-intervals", "compare-1-gap-over-time", "compare-1-dependence",
    "compare-1-heat-map", "compare-1-playback",
]  # fmt: skip

STAGES = {Diagnosis: "diagnose", Disagreement: "compare", Extended: "extend"}


def written(path, given):
    """Write a result that is sound; an extended model as if it came of the diagnosis next to it."""
    assert store.findings(given) == []
    source = path.with_name("diagnosis.h5")
    inputs = {"diagnosis": input_file(source)} if isinstance(given, Extended) and source.exists() else {}
    store.write(path, given, Origin(stage=STAGES[type(given)], seed=1, config="seed: 1\n", inputs=inputs))
    return path


def shown(folder, *artifacts, options=()):
    """Write artifacts and a report about them; give its summary, its HTML and its text."""
    config, output = folder / "study.yaml", folder / "report.html"
    config.write_text("seed: 1\n" + VEHICLE)
    paths = [written(folder / f"{number}.h5", each) for number, each in enumerate(artifacts)]
    result = run.done("report", config, *paths, "-o", output, "--json", "--force", *options)
    html = output.read_text(encoding="utf-8")
    body = re.sub(r"<style>.*?</style>|<svg.*?</svg>", "", html, flags=re.DOTALL)
    text = re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", body)))
    return SimpleNamespace(summary=json.loads(result.stdout), html=html, text=text, paths=paths)


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gap")
    diagnosis = made.diagnosis()
    written(folder / "diagnosis.h5", diagnosis)
    with drawn(shown=False):
        return shown(folder, made.disagreement(), diagnosis, made.extended())


def test_the_answer_comes_first_and_every_figure_once(full):
    assert full.summary["sections"] == [
        "summary", "diagnose", "extend", "compare", "stated-vehicle", "provenance",
    ]  # fmt: skip
    assert full.summary["figures"] == GAP_FIGURES
    assert full.summary["missing"] == []
    first = full.text[: full.text.index("measured and simulated")]
    for words in ("NAMED", "What the model misses is offset of the centre of mass.", made.SENTENCE, "97 % is gone",
                  "Held out : two.csv", "Fitted to : one.csv"):  # fmt: skip
        assert words in first, words
    assert "Where simulation and flight disagree" in full.text
    assert "No model was given" not in full.text


def test_numbers_of_the_artifacts_stand_in_the_tables(full):
    for words in ("0.494", "0.0136", "0.0123", "40 1.1", "70 1.2"):
        assert words in full.text, words
    assert "0.0100 0.0090 … 0.0111 m −0.0600 … 0.0600" in full.text
    assert "< 10⁻⁶" in full.text
    assert "moment of inertia about x 2.1 1.0 … 3.0 %" in full.text
    assert "1.0123" in full.text
    assert "two.csv roll torque 1.0 … 2.0 33.3" in full.text
    for words in ("one.csv: rotor 2 looks saturated", "A note that readers need."):
        assert full.text.count(words) == 1, words
    # The comparison and the diagnosis say both of their own flights.
    for words in ("Fly near the ground.", "12 ms"):
        assert full.text.count(words) == 2, words


def test_the_model_that_runs_away_does_not_flatten_the_picture(full):
    assert "the model as given leaves the figure" in full.text


def test_what_is_lacking_is_left_out_and_said(tmp_path):
    page = shown(tmp_path, replace(made.diagnosis(force=False), run=None, picture=None, playback=None))
    assert page.summary["figures"] == ["diagnose-1-gap-sizes", "diagnose-1-intervals"]
    assert page.summary["missing"] == ["disagreement", "extended"]
    assert "too short to simulate" in page.text
    assert "cpfls compare CONFIG FLIGHT" in page.text
    assert "force along" not in page.text[: page.text.index("effects and their coefficients")]


def test_a_disagreement_alone_says_where_and_how_to_go_on(tmp_path):
    page = shown(tmp_path, replace(made.disagreement(force=False), heat_map=None, playback=None))
    assert page.summary["figures"] == ["compare-1-gap-over-time", "compare-1-dependence"]
    assert "The gap is largest in the torque about x (roll): 12.0 noise floors." in page.text
    assert "It follows thrust most." in page.text
    assert "cpfls diagnose" in page.text


def test_an_extended_model_alone_brings_its_figures(tmp_path):
    page = shown(tmp_path, made.extended())
    assert page.summary["figures"] == [
        "extend-1-gap-sizes", "extend-1-playback", "extend-1-intervals",
    ]  # fmt: skip
    assert "the model with offset of the centre of mass" in page.text
    assert "its largest gap is 1.2 noise floors; it was 70" in page.text


def test_a_fault_of_a_sensor_stands_under_sensors(tmp_path):
    page = shown(tmp_path, made.diagnosis(named=("gyro_bias",), audit=made.audit_with_fault()))
    assert "SENSOR FAULT" in page.text
    assert "The gyroscope shows 0.01 rad/s at rest. The diagnosis repairs it" in page.text
    assert "Not tested for gyro scale and misaligned IMU: no attitude." in page.text
    assert "without the faults of the sensors" in page.text
