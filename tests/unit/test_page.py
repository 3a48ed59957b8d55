"""Templates in Markdown, shown on a terminal, as HTML and as Markdown."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from jinja2 import UndefinedError

from cpfls_cli import page
from cpfls_cli.report.content import Facts, Folded, Heading, Table, Text
from cpfls_cli.report.terminal import terminal_lines
from cpfls_cli.result import Estimate

HOSTILE = "a_b__c*d* `e` [f](javascript:x) <script>alert(1)</script> | {good} \u202egpj\x1b[2J\n# g"
PAGE = """\
# Flies well {good}

First *words*.

- **Mass**: 1.5 kg
- **Rotors**: 4
- two words

## Health
### Balance {warning}
| Rotor | Works | Why |
| :-- | --: | :-- |
| M1 | yes {good} | it does what the other three do, within what they differ by |

![Shares of *thrust*](shares)
::: More of it
Inside.

> a note inside
:::
## Empty
::: Opened {open}
Shown.
:::
```
::: no fold
```
> a note
"""


def worded(tmp_path, template, given=None, **more):
    (tmp_path / "own.md.j2").write_text(template)
    return page.words("own", given, folder=tmp_path, **more)


def lines(text, width=None, whole=False):
    return list(terminal_lines(page.blocks(text), width, whole=whole))


def estimate(value, low, high):
    return Estimate(value=value, low=low, high=high)


def test_no_data_is_taken_for_markdown_or_html(tmp_path):
    text = worded(tmp_path, "# {{ r }}\n{{ r }}\n\n- {{ r }}\n\n{{ table(('Name', r), [(r, 1.0)]) }}\n", HOSTILE)
    plain = "a_b__c*d* `e` [f](javascript:x) <script>alert(1)</script> | {good} \\u202egpj\\x1b[2J # g"
    said = page.blocks(text)
    assert (said[:3], said[3].header) == ([Heading(plain), Text(plain), Text(f"- {plain}")], ["Name", plain])
    assert [each.text for each in said[3].rows[0]] == [plain, "1.000"]
    shown = page.html(HOSTILE, text, {})
    assert "<script" not in shown
    assert "href" not in shown.split("<main")[1]
    assert "<em>" not in shown
    assert "\u202e" not in shown
    assert "\x1b" not in shown
    assert shown.count("&lt;script&gt;alert(1)&lt;/script&gt;") == 8


@pytest.mark.parametrize(
    "name", ["- a", "1. a", "1) b", "+ c", "::: d", "```", "    e", "# f", "> g", "=== h", "__init__", "~~x~~"]
)
def test_data_at_the_beginning_of_a_line_begins_nothing(tmp_path, name):
    assert page.blocks(worded(tmp_path, "{{ r }}\n", name)) == [Text(name.strip())]


@pytest.mark.parametrize("text", ["cpfls look a*b*|c", "a`b", "``", "`", "<b>"])
def test_code_is_shown_as_it_is(tmp_path, text):
    (said,) = page.blocks(worded(tmp_path, "{{ r | code }}\n", text))
    assert said == Text(f"`{text}`")
    said = page.blocks(worded(tmp_path, "{{ table(('a', 'b'), [(r | code, 2)]) }}\n", text))[0]
    assert [each.text for each in said.rows[0]] == [f"`{text}`", "2"]


def test_nothing_is_shown_of_nothing():
    assert page.blocks("# \n") == page.blocks("") == []


def test_what_a_macro_gives_stays_markdown(tmp_path):
    text = worded(
        tmp_path, "{% macro m(x) %}**{{ x }}**{% endmacro %}{{ m(r) }} and {{ [m(r), 'y'] | joined }}\n", "*x*"
    )
    assert "<strong>*x*</strong> and <strong>*x*</strong> and y" in page.html("t", text, {})


TEXTS = [
    [],
    ["one"],
    ["one", HOSTILE, "'a' | \"b\" {warning}", "> c", "::: d", "- e", "<b>&amp;"],
    [1, None, "f"],
    [page.code("`g`")],
]


@pytest.mark.parametrize("texts", TEXTS)
@pytest.mark.parametrize(
    ("tag", "loop"),
    [
        ("{% notes r %}", "> {{ each }}"),
        ('{% notes r, "warning" %}', "> {{ each }} {warning}"),
        ("{% paragraphs r %}", "{{ each }}"),
        ('{% paragraphs r | map("string"), "note" %}', "{{ each | string }} {note}"),
    ],
)
def test_several_at_once_are_what_a_loop_over_them_gives(tmp_path, tag, loop, texts):
    (tmp_path / "tag.md.j2").write_text(f"# Begins\n\n{tag}\nEnds.\n")
    (tmp_path / "loop.md.j2").write_text(f"# Begins\n\n{{% for each in r %}}\n{loop}\n\n{{% endfor %}}\nEnds.\n")
    shown = [page.words(name, texts, folder=tmp_path) for name in ("tag", "loop")]
    assert shown[0] == shown[1]


def test_a_list_is_what_a_loop_appends(tmp_path):
    (tmp_path / "a.md.j2").write_text("""\
{% list whole = "%s%s" | format(name, loop.index0) for name, size in r.items() if size %}
{% list sums = (x + y if x else y) for x, y in zip([0, 1, 2], [3, 4, 5]) %}
{% for own in ["a", "b"] %}{% list each = own ~ x for x in [1, 2] %}{{ each | join("+") }} {% endfor %}
{% macro of(xs) %}{% list twice = 2 * x for x in xs %}{{ twice | join(",") }}{% endmacro %}
{{ whole | join(",") }} {{ sums | join(",") }} {{ of([1, 2]) }} {% list none_ = x for x in [] %}{{ none_ | length }}
""")
    said = page.words("a", {"p": 1, "q": 0, "s": 2}, folder=tmp_path)
    assert said.split() == ["a1+a2", "b1+b2", "p0,s1", "3,5,7", "2,4", "0"]


@pytest.mark.parametrize("text", ["{% notes nothing %}", "{% paragraphs [nothing] %}"])
def test_a_name_that_nothing_gives_is_an_error_in_several_at_once_too(tmp_path, text):
    (tmp_path / "a.md.j2").write_text(text)
    with pytest.raises(UndefinedError, match="'nothing' is undefined"):
        page.words("a", None, folder=tmp_path)


def test_a_name_that_a_result_lacks_is_an_error(tmp_path):
    with pytest.raises(UndefinedError):
        worded(tmp_path, "{{ r.none }}", estimate(1.0, 0.0, 2.0))


@pytest.mark.parametrize(
    ("own", "unit", "factor", "said"),
    [
        (estimate(163.2, 126.0, 200.4), "", 1.0, "163 ± 37"),
        (estimate(0.251, 0.230, 0.272), "%", 100.0, "25.1 ± 2.1 %"),
        (estimate(-5.0, -6.04, -3.96), "ms", 1.0, "−5.0 ± 1.0 ms"),
        (estimate(-5.0, -6.04, -3.96), "ms", -1.0, "5.0 ± 1.0 ms"),
        (estimate(10.0, 9.0, 14.0), "Hz", 1.0, "10.0 [9.0, 14.0] Hz"),
        (estimate(3.0, np.nan, np.nan), "", 1.0, "3"),
        (estimate(np.nan, np.nan, np.nan), "Hz", 1.0, "—"),
        (estimate(2.0, -np.inf, np.inf), "", 1.0, "2"),
        (None, "Hz", 1.0, "—"),
    ],
)
def test_numbers_with_intervals(own, unit, factor, said):
    assert page.interval(own, unit, factor) == said


def test_words_for_numbers(tmp_path):
    template = (
        "{{ 1 | plural('rotor') }}, {{ 2 | plural('battery', 'batteries') }}, {{ r | percent }}, {{ r | number(2) }}"
    )
    assert worded(tmp_path, template, 0.254) == "1 rotor, 2 batteries, 25 %, 0.25"
    assert list(map(page.duration, (4.21, 42.4, 99.7, 180.0, np.nan))) == ["4.2 s", "42 s", "1 min 40 s", "3 min", "—"]


def test_a_terminal_shows_the_answer_and_names_what_is_folded():
    said = page.blocks(PAGE)
    assert said[:4] == [
        Heading("Flies well"),
        Text("First words."),
        Facts([("Mass", "1.5 kg"), ("Rotors", "4")]),
        Text("- two words"),
    ]
    # Nothing but a heading and a fold stand below "Health", and nothing at all below "Empty".
    assert said[4] == Heading("Balance")
    assert isinstance(said[5], Table)
    assert (said[5].rows[0][1].tone, said[5].words, said[5].sentences) == ("good", {0, 2}, {2})
    assert said[6] == Folded("More of it", [Text("Inside."), Text("a note inside", "warning")])
    assert (said[7], said[-1]) == (Folded("Opened", [Text("Shown.")], shown=True), Text("a note", "warning"))
    assert not any(isinstance(each, Heading) and each.text in {"Health", "Empty"} for each in said)


@pytest.mark.parametrize("width", [40, 80])
def test_no_line_is_wider_than_the_terminal(width):
    said = lines(PAGE, width, whole=True)
    assert max(map(len, said)) <= width
    assert "Inside." in said
    assert "Inside." not in lines(PAGE, width)


class Structure(HTMLParser):
    """Tags that are open, and those that were closed in another order."""

    def __init__(self):
        super().__init__()
        self.open, self.wrong, self.tags = [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "br", "hr"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if self.open.pop() != tag:
            self.wrong.append(tag)


def test_a_page_is_whole_and_needs_nothing_else():
    shown = page.html("a.bbl", PAGE, {"shares": lambda: "<svg></svg>"})
    parsed = Structure()
    parsed.feed(shown)
    assert (parsed.open, parsed.wrong) == ([], [])
    assert not re.search(r"https?://|url\(|@import|<link|<script", shown)
    assert "default-src 'none'" in shown
    tags = [tag for tag, _ in parsed.tags]
    assert tags.count("h1") == tags.count("main") == 1
    assert tags.count("section") == 2
    assert ("header", {"class": "good"}) in parsed.tags
    assert ("article", {"class": "card warning"}) in parsed.tags
    assert ("th", {"style": "text-align:left", "scope": "row"}) in parsed.tags
    assert ("td", {"style": "text-align:right", "class": "good", "data-title": "Works"}) in parsed.tags
    assert ("th", {"style": "text-align:right", "scope": "col"}) in parsed.tags
    assert (tags.count("th"), tags.count("td")) == (4, 2)
    assert ("div", {"class": "table prose", "tabindex": "0"}) in parsed.tags
    assert "<figcaption>Shares of <em>thrust</em></figcaption>" in shown
    assert "<details><summary>More of it</summary><p>Inside.</p>" in shown
    assert "<h3>Opened</h3><p>Shown.</p>" in shown
    assert "::: no fold" in shown
    assert "{" not in shown.split("<body>")[1]


def test_a_figure_of_nothing_is_left_out():
    assert "<figure" not in page.html("a", PAGE, {"shares": lambda: ""})


def test_markdown_is_what_every_reader_knows():
    said = page.markdown(PAGE)
    assert "{" not in said
    assert "### More of it\n\nInside." in said
    assert "*Figure: Shares of *thrust**" in said
    assert "| M1 | **yes** | it does" in said
