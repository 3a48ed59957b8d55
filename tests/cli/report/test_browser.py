"""The page in a browser: on a phone, in the dark, on a wide screen; nothing asked of any network."""

import html
import json
import re
import shutil
import subprocess
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest

from tests.builders.command_line import drawn
from tests.builders.evidence_artifacts import with_evidence

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to show the page in")
PHONE, PAPER, HEIGHT = 360, 750, 800
QUIET = (
    "headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "disable-background-networking",
    "disable-component-update", "disable-sync", "disable-default-apps", "hide-scrollbars", "enable-logging=stderr",
    "host-resolver-rules=MAP * ~NOTFOUND", "virtual-time-budget=4000",
)  # fmt: skip
# Told by the pages inside frames of the sizes of screens: windows cannot be as narrow as a phone.
MEASURE = """
<script>
addEventListener("load", () => {
  const box = (element) => element.getBoundingClientRect();
  const told = [...document.querySelectorAll("iframe")].map((frame) => {
    const page = frame.contentDocument;
    return {
      width: page.documentElement.scrollWidth,
      sections: [...page.querySelectorAll("main > section")].map((each) => [each.id, box(each).top, box(each).bottom]),
      figures: [...page.querySelectorAll("figure")].map((each) => [each.id, box(each.querySelector("svg")).width,
        box(each.querySelector("svg")).height, box(each).right]),
      asked: performance.getEntriesByType("resource").concat(
        page.defaultView.performance.getEntriesByType("resource")).map((each) => each.name),
      links: [...page.querySelectorAll("nav a")].map((each) => page.querySelector(each.getAttribute("href")) !== null),
      background: page.defaultView.getComputedStyle(page.body).backgroundColor,
      figure: page.defaultView.getComputedStyle(page.querySelector("figure")).backgroundColor,
    };
  });
  const result = document.createElement("pre");
  result.id = "told";
  result.textContent = JSON.stringify(told);
  document.body.append(result);
});
</script>
"""


@pytest.fixture(scope="module")
def page(cpfls, pipeline, study, tmp_path_factory):
    """A report with everything: two models, of which one holds evidence."""
    folder = tmp_path_factory.mktemp("browser")
    model, output = with_evidence(pipeline.model, folder / "other.h5"), folder / "report.html"
    with drawn():
        result = cpfls("report", study, *pipeline.paths.values(), model, "-o", output, "--json")
    assert result.exit_code == 0, result.stderr
    return SimpleNamespace(text=output.read_text(encoding="utf-8"), path=output, **json.loads(result.stdout))


@pytest.fixture(scope="module")
def browse(tmp_path_factory):
    profile = tmp_path_factory.mktemp("profile")

    def call(path, *options):
        flags = [f"--{option}" for option in (*QUIET, f"user-data-dir={profile}", *options)]
        done = subprocess.run(
            [CHROMIUM, *flags, path.as_uri()], capture_output=True, text=True, check=True, timeout=120
        )
        assert "CONSOLE" not in done.stderr, done.stderr
        return done.stdout

    return call


def framed(folder, name, height, pages):
    """Put pages into one file, each in a frame of some width."""
    path = folder / f"{name}.html"
    frames = "".join(
        f'<iframe style="width:{width}px;height:{height}px;border:0" srcdoc="{html.escape(text)}"></iframe>'
        for width, text in pages.items()
    )
    path.write_text(f'<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">{frames}{MEASURE}', encoding="utf-8")
    return path


def summary(browse, path, scheme):
    shown = browse(path, "dump-dom", f"window-size=1400,{HEIGHT}", f"blink-settings=preferredColorScheme={scheme}")
    return json.loads(html.unescape(re.search(r'<pre id="told">(.*?)</pre>', shown, re.DOTALL)[1]))


@pytest.fixture(scope="module")
def light(browse, page):
    """What is seen of the page where it is light, by the width of the screen, and of the printed one on paper."""
    pages = {PHONE: page.text, 1400: page.text, 900: page.text, PAPER: printed(page.text)}
    return dict(zip(pages, summary(browse, framed(page.path.parent, "light", HEIGHT, pages), 1), strict=True))


def printed(text):
    return text.replace("@media print", "@media all")


@pytest.mark.parametrize("width", [PHONE, 1400])
def test_every_section_and_figure_is_there_and_the_page_is_no_wider_than_the_screen(light, page, width):
    seen = light[width]
    assert seen["width"] <= width
    assert [name for name, _, _ in seen["sections"]] == page.sections
    assert all(bottom - top > 60 for _, top, bottom in seen["sections"])
    assert [name for name, *_ in seen["figures"]] == page.figures
    for name, across, high, right in seen["figures"]:
        assert across > 300, name
        assert high > 50, name
        assert right <= width, name
    assert all(seen["links"])
    assert len(seen["links"]) == len(page.sections)
    assert seen["asked"] == []


def test_it_is_dark_where_the_reader_wants_it_dark(browse, page, light):
    (dark,) = summary(browse, framed(page.path.parent, "dark", HEIGHT, {900: page.text}), 0)
    grounds = {
        scheme: [sum(map(int, re.findall(r"\d+", seen[key])[:3])) for key in ("background", "figure")]
        for scheme, seen in (("dark", dark), ("light", light[900]))
    }
    assert max(grounds["dark"]) < 150 < 600 < min(grounds["light"])


def test_a_picture_of_every_section_shows_something(browse, page, light, tmp_path):
    width, scale = 900, 0.5
    seen = light[width]
    height = int(max(bottom for _, _, bottom in seen["sections"])) + 100
    picture = tmp_path / "page.png"
    browse(
        framed(tmp_path, "whole", height, {width: page.text}), f"screenshot={picture}",
        f"window-size={width},{height}", f"force-device-scale-factor={scale}",
    )  # fmt: skip
    pixels = matplotlib.image.imread(picture)[:, :, :3]
    assert pixels.shape[0] >= scale * height - 2
    ground = pixels[5, 2]
    for name, top, bottom in seen["sections"]:
        drawn = np.abs(pixels[int(scale * top) : int(scale * bottom)] - ground).max(axis=2) > 0.1
        assert drawn.mean() > 0.01, name


def test_the_printed_page_is_black_on_white_and_folds_the_data_of_its_figures(light):
    seen = light[PAPER]
    assert seen["background"] == "rgb(255, 255, 255)"
    assert seen["width"] <= 750
