"""A laboratory's own templates: a section in five lines, and every slip told where it stands."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

from campaign.errors import UsageError
from campaign.report.page.templates import Templates

pytestmark = pytest.mark.usefixtures("drawings_kept")


@pytest.fixture
def page(made_up: ModuleType, tmp_path: Path):
    """Builds the page with the given files as a laboratory's own templates."""

    def build(**files: str) -> str:
        own = tmp_path / "own"
        own.mkdir(exist_ok=True)
        for name, text in files.items():
            (own / name.replace("_", ".")).write_text(text, encoding="utf-8")
        return made_up.build(
            made_up.made_up_run(tmp_path, tests={"stabilization": ("5.8",)}),
            tmp_path / "out",
            templates=own,
        ).path.read_text(encoding="utf-8")

    return build


EXTENDS = '{% extends "campaign/report.html" %}\n'


def own(block: str, inside: str) -> str:
    return f"{EXTENDS}{{% block {block} %}}{inside}{{% endblock %}}\n"


def test_a_section_is_replaced_in_a_few_lines_and_the_rest_stays(page) -> None:
    text = page(report_html=own("provenance", "<p>Ask {{ header.name }}'s operator.</p>"))
    assert "<p>Ask 2026-11-21T09-36-58-made-up's operator.</p>" in text
    assert "Archive SHA-256" not in text
    assert 'id="scoreboard"' in text
    assert 'id="test-1"' in text


def test_a_section_is_added_to(page) -> None:
    text = page(report_html=own("masthead", "<p>Hall 3</p>{{ super() }}"))
    assert text.index("<p>Hall 3</p>") < text.index('<header class="masthead">')


def test_one_test_s_section_is_replaced_and_its_variable_is_there(page) -> None:
    inside = "<h2>{{ section.test.title }}</h2><p>by hand</p>"
    text = page(report_html=own("section", inside))
    assert "<h2>Stabilization</h2><p>by hand</p>" in text
    assert 'id="test-1"' not in text


def test_every_block_of_the_page_can_be_replaced(made_up: ModuleType, page) -> None:
    source = (made_up.TEMPLATES / "report.html").read_text()
    names = re.findall(r"{% block (\w+)", source)
    assert len(names) >= 13
    for some in (set(names) - {"sections"}, {"sections"}):
        replaced = "".join(f"{{% block {name} %}}/*my {name}*/{{% endblock %}}" for name in some)
        text = page(report_html=EXTENDS + replaced)
        assert {name for name in names if f"/*my {name}*/" in text} == some


def test_own_files_may_include_each_other_and_the_packaged_ones(page) -> None:
    text = page(
        report_html=own("provenance", '{% include "address.html" %}{{ super() }}'),
        address_html="<p>Hall 3</p>",
        style_css='{% include "campaign/style.css" %}\n.mine { color: red }',
    )
    assert "<p>Hall 3</p>" in text
    assert ".mine { color: red }" in text
    assert ".masthead {" in text


def test_a_picture_or_a_note_beside_the_templates_is_nobody_s_business(page) -> None:
    assert "Provenance" in page(logo_svg="<svg/>", README_md="ours")


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (
            {"report_html": '{% extends "report.html" %}'},
            (
                "report.html:1: report.html extends itself; the packaged one is called"
                """ 'campaign/report.html': write {% extends "campaign/report.html" %}"""
            ),
        ),
        (
            {"provenence_html": "x"},
            (
                "provenence.html: no template of the report is called 'provenence.html', and none"
                " of these includes it; did you mean 'provenance.html'?"
            ),
        ),
        ({"zzz_html": "x"}, "; there are article.html, cite.html, incidents.html, "),
        (
            {"report_html": EXTENDS + "\n{% block provenence %}x{% endblock %}"},
            (
                "report.html:3: campaign/report.html has no block 'provenence'; did you mean"
                " 'provenance'?"
            ),
        ),
        (
            {"report_html": EXTENDS + "{% if run %}{% block zzz %}{% endblock %}{% endif %}"},
            "report.html:2: campaign/report.html has no block 'zzz'; there are contents",
        ),
        (
            {"report_html": EXTENDS + "\n<p>lost</p>"},
            "report.html:3: stands outside of all blocks and would not be shown",
        ),
        (
            {"report_html": EXTENDS + "{% set a = 1 %}\n{{ a }}"},
            "stands outside of all blocks",
        ),
        (
            {"report_html": '{% extends "campaign/reprot.html" %}'},
            (
                "report.html:1: there is no template 'campaign/reprot.html'; did you mean"
                " 'campaign/report.html'?"
            ),
        ),
        ({"test_html": "\n{% include 'none.html' %}"}, "test.html:2: there is no template"),
        ({"test_html": "\n\n{{ hedaer.name }}"}, "test.html:3: there is no name 'hedaer'; did you"),
        ({"test_html": "{{ report.x }}"}, "test.html:1: there is no name 'report'; there are agre"),
        ({"test_html": "{{ header.titel }}"}, "a RunHeader has no 'titel'; did you mean 'title'?"),
        (
            {"test_html": "{{ header.zzzzzz.name }}"},
            "test.html:1: a RunHeader has no 'zzzzzz'; there are backend, ",
        ),
        ({"test_html": "{{ header.title.x }}"}, "test.html:1: a text has no 'x'"),
        (
            {"test_html": "{{ anchors.zzz }}"},
            "test.html:1: a table of names has no 'zzz'; there are",
        ),
        ({"test_html": "{{ failed[9].x }}"}, "test.html:1: a tuple of 1 has no element 9"),
        ({"test_html": "\n{% fro x in y %}"}, "test.html:2: Encountered unknown tag 'fro'"),
        ({"test_html": "a\n{% if run %}"}, "test.html:2: Unexpected end of template"),
        ({"test_html": "a\n{{ 1 / 0 }}"}, "test.html:2: cannot be filled: ZeroDivisionError: "),
        ({"test_html": '{% include "test.html" %}'}, "include each other without end"),
        ({"test_html": "{{ header.name | capitalise }}"}, "test.html:1: No filter named"),
    ],
)
def test_a_slip_is_told_with_its_place_and_what_to_write(page, tmp_path, files, message) -> None:
    with pytest.raises(UsageError, match=re.escape(message)) as told:
        page(**files)
    assert str(told.value).startswith(str(tmp_path / "own"))
    assert len(str(told.value).splitlines()) == 1


def test_all_slips_are_told_at_once(page) -> None:
    with pytest.raises(UsageError) as told:
        page(report_html=own("foot", "x"), provenence_html="", test_html="{% include 'no' %}")
    assert len(str(told.value).splitlines()) == 3
    with pytest.raises(UsageError) as told:
        page(report_html=own("foot", "x"), opening_html="{% for %}", test_html="{% if %}")
    assert len(str(told.value).splitlines()) == 2  # what the others refer to may be in these


def test_templates_in_a_folder_below_are_found_by_who_names_them(page, tmp_path: Path) -> None:
    (tmp_path / "own" / "parts").mkdir(parents=True)
    (tmp_path / "own" / "parts" / "address.html").write_text("<p>Hall 3</p>")
    assert "Hall 3" in page(report_html=own("provenance", '{% include "parts/address.html" %}'))
    (tmp_path / "own" / "parts" / "base.html").write_text("\n{% if %}")
    with pytest.raises(UsageError, match=r"own/parts/base\.html:2: "):
        page(report_html='{% extends "parts/base.html" %}{% block a %}{% endblock %}')


def test_a_template_that_is_no_text_is_told(page, tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "test.html").write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match=r"test\.html: is no UTF-8 text"):
        page()


def test_a_block_within_a_replaced_block_is_new_and_allowed(page) -> None:
    inside = "{% block address %}<p>Hall 3</p>{% endblock %}"
    assert "<p>Hall 3</p>" in page(report_html=own("provenance", inside))


# --- the manual -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def manual(made_up: ModuleType) -> str:
    return (made_up.ROOT / "docs" / "templates.md").read_text(encoding="utf-8")


def test_the_worked_example_works(made_up: ModuleType, manual: str, page, tmp_path: Path) -> None:
    files = dict(re.findall(r"^```html (\S+)\n(.*?)^```$", manual, re.MULTILINE | re.DOTALL))
    assert list(files) == ["report.html", "address.html", "trial.html"]
    text = page(**{name.replace(".", "_"): content for name, content in files.items()})
    address, masthead = text.index("Hall 3"), text.index('<header class="masthead">')
    assert address < masthead
    assert ".laboratory {" in text.split("</style>")[0]
    assert ".masthead {" in text.split("</style>")[0]
    assert "<h2>Records</h2>" in text
    assert "Versions and machine" not in text
    assert "4 trials were executed for this report; of those that did not complete, 4," in text
    assert text.index('id="test-1"') < text.index('id="release"') < text.index('id="failed"')


@pytest.mark.parametrize("place", [0, 1])
def test_the_short_examples_work(manual: str, page, place: int) -> None:
    text = re.findall(r"^```html\n(.*?)^```$", manual, re.MULTILINE | re.DOTALL)[place]
    made = page(report_html=text)
    assert ("Versions and machine" not in made, "<h2>Ours</h2>" in made) == (not place, bool(place))


def test_the_manual_has_every_block_file_and_name(
    made_up: ModuleType, manual: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: dict[str, set[str]] = {}
    fill = Templates.fill

    def noting(self: Templates, name: str, context: dict) -> str:
        given[name] = set(context)
        return fill(self, name, context)

    monkeypatch.setattr(Templates, "fill", noting)
    made_up.build(
        made_up.made_up_run(tmp_path, tests={"stabilization": ()}), tmp_path / "out", trials=(1,)
    )
    report, trial = manual.split("Names of `trial.html`:")
    told = [
        set(re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (.*?) \|", part, re.MULTILINE))))
        for part in (report.split("## What a template is given")[1], trial)
    ]
    assert told[0] == given["report.html"]
    assert told[1] >= given["trial.html"]
    for name in ("report.html", "trial.html"):
        for block in re.findall(r"{% block (\w+)", (made_up.TEMPLATES / name).read_text()):
            assert f"`{block}`" in report.split("## What can be replaced")[1]
    for path in made_up.TEMPLATES.iterdir():
        assert f"`{path.name}`" in manual


def test_what_the_manual_says_of_slips_is_said(manual: str, page) -> None:
    slips = {
        "provenence_html": "did you mean 'provenance.html'",
        "report_html": "did you mean 'provenance'",
        "test_html": "did you mean 'address.html'",
    }
    with pytest.raises(UsageError) as told:
        page(
            provenence_html="",
            report_html=own("provenence", ""),
            address_html="",
            test_html='{% include "adress.html" %}',
        )
    assert all(slip in str(told.value) for slip in slips.values())
