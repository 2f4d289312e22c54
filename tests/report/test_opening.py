"""The first minute of a page: of runs that found something, nothing, the contrary, or failed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.estimate import Estimate, Origin
from campaign.experiments.interface import Experiment, TestData
from campaign.published.headline import is_compared, once
from campaign.reason import NONE, Reason
from campaign.recording import Ending, Outcome, SafeState
from campaign.report.build import render
from campaign.report.content.citation import citation_of
from campaign.report.content.document import document_of
from campaign.report.content.first_screen import FirstScreen
from campaign.report.content.run_problems import without_trials
from campaign.result import Axis, Column, Curve, Figure, Finding, Panel, Result, Table

pytestmark = pytest.mark.usefixtures("drawings_kept")


def estimate(value: float, low: float | None = None, high: float | None = None) -> Estimate:
    reason = NONE if low is not None else Reason("test", "a single value")
    return Estimate("error", value, "rad", low, high, 0.95, reason=reason)


def says(*findings: Finding, **more: object) -> Callable[[TestData], Result]:
    return lambda data: Result(findings=findings, **more)


def ratio(value: float, low: float | None, high: float | None) -> Finding:
    return Finding.of(Estimate("error_reduction", value, "", low, high, 0.95), {})


def figure(key: str, *, interval: bool = False) -> Figure:
    x = np.arange(5.0)
    ends = {"low": x - 1, "high": x + 1} if interval else {}
    curve = Curve(x, x, "measured", "measured", "points", **ends)
    axis = Axis("Rate", "rad/s")
    return Figure(key, f"Figure {key}", "A caption.", "A line.", (Panel(axis, axis, [curve]),))


def experiments(made_up: ModuleType, **analyses: Callable[[TestData], Result]) -> dict:
    return {
        kind: Experiment(kind, kind, made_up.ShakeOptions, lambda options, bench: (), analyse)
        for kind, analyse in analyses.items()
    }


def opening(made_up: ModuleType, folder: Path, /, *, run: RunReader | None = None, **analyses):
    """The opening of a run of one test of each kind."""
    found = run or made_up.made_up_run(folder, tests=dict.fromkeys(analyses, ()))
    return document_of(found, experiments(made_up, **analyses)).opening


def spoken(found: FirstScreen) -> str:
    said = [found.asked, *found.wrong, found.compared]
    for answer in found.answers:
        said += [
            *(each.value for each in answer.numbers),
            *answer.remarks,
            answer.truth,
            answer.problem,
        ]
    return "\n".join(said)


def completed(run: RunReader) -> RunReader:
    trials = tuple(replace(each, ending=Ending(Outcome.COMPLETED)) for each in run.trials)
    return replace(run, trials=trials, status=RunStatus.COMPLETE)


def test_a_run_as_planned_says_what_was_asked_and_found(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    alone = Finding.of(estimate(2e-4), {})
    found = opening(made_up, tmp_path, run=run, stabilization=says(ratio(2.9, 2.7, 3.1), alone))
    assert found.asked == "1 test, 4 trials on the bench simulink, simulated."
    assert found.wrong == ()
    assert found.compared == ""
    (answer,) = found.answers
    assert [each.value for each in answer.numbers] == ["2.90 ± 0.20", "0.01146 °"]
    assert answer.remarks == ("Without an interval: a single value.",)
    assert (answer.title, answer.problem) == ("Stabilization", "")


def test_a_run_that_found_nothing_says_why(made_up: ModuleType, tmp_path: Path):
    note = "No reading has both a rate and a torque: friction in motion is not determined."
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    found = opening(made_up, tmp_path, run=run, stabilization=lambda data: Result(notes=(note,)))
    assert found.answers[0].numbers == ()
    assert found.answers[0].problem == note.rstrip(".")
    assert found.telling is None


def test_a_number_that_was_not_determined_is_none(made_up: ModuleType, tmp_path: Path):
    open_ = Estimate(
        "e", math.nan, "rad", reason=Reason("test", "lost"), origin=Origin.NOT_DETERMINED
    )
    found = opening(made_up, tmp_path, stabilization=says(Finding.of(open_, {})))
    assert [each.value for each in found.answers[0].numbers] == ["not determined (lost)"]


def test_an_analysis_with_tables_alone_is_no_failure(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    plain = Result(tables=(Table("t", "T", (Column("a", "A", exact=True),), ({"a": 1},)),))
    found = opening(made_up, tmp_path, run=run, stabilization=lambda data: plain)
    assert (found.answers[0].numbers, found.answers[0].problem) == ((), "")
    assert found.wrong == ()


# What went wrong ----------------------------------------------------------------------------------


def test_some_failed_trials_are_counted_with_the_commonest_reason(
    made_up: ModuleType, tmp_path: Path
):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": (), "velocity_map": ()})
    endings = [
        Ending(Outcome.COMPLETED),
        Ending(Outcome.LIMIT, "current 93.1 A is over the limit of 90 A"),
        Ending(Outcome.FAULT, "lost connection"),
        Ending(Outcome.LIMIT, "current 91.7 A is over the limit of 90 A"),
    ]
    trials = [
        replace(t, ending=endings[n] if n < 4 else endings[0]) for n, t in enumerate(run.trials)
    ]
    run = replace(run, trials=tuple(trials))
    found = opening(made_up, tmp_path, run=run, stabilization=says(), velocity_map=says())
    (told,) = found.wrong
    assert told == (
        "3 of 8 executed trials did not complete (2 ended at a limit, 1 failed by a fault); "
        "the commonest reason (2), such as: current 93.1 A is over the limit of 90 A."
    )


def test_one_interrupted_trial_was_interrupted(made_up: ModuleType, tmp_path: Path):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()})
    first, *others = (replace(t, ending=Ending(Outcome.COMPLETED)) for t in run.trials)
    stopped = replace(first, ending=Ending(Outcome.INTERRUPTED, "stopped by Ctrl-C"))
    run = replace(run, trials=(stopped, *others))
    (told,) = opening(made_up, tmp_path, run=run, stabilization=says()).wrong
    assert "(1 was interrupted)" in told


def test_a_test_all_of_whose_trials_failed_has_no_answer(made_up: ModuleType, tmp_path: Path):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()})
    hot = Ending(Outcome.FAULT, "over-temperature")
    run = replace(run, trials=tuple(replace(each, ending=hot) for each in run.trials))
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.wrong == (
        "4 of 4 executed trials did not complete (4 failed by a fault); such as: over-temperature.",
    )
    assert found.answers[0].problem == "none of its 4 executed trials completed"


def test_a_method_that_was_planned_and_never_ran_is_named(made_up: ModuleType, tmp_path: Path):
    """Also where its trials are missing, and the analysis has no reason to speak of it."""
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    (test,) = run.header.tests
    planned = {**test, "matrix": {"compensation": ["none", "static", "lugre", "observer"]}}
    run = replace(run, header=run.header.model_copy(update={"tests": (planned,)}))
    told = says(ratio(2.9, 2.7, 3.1))
    assert opening(made_up, tmp_path, run=run, stabilization=told).wrong == ()
    without = replace(run, trials=tuple(t for t in run.trials if t.trial.number != 3))
    found = opening(made_up, tmp_path, run=without, stabilization=told).wrong
    said = (
        "No trial with the LuGre model completed in Stabilization: it was planned, and is in none "
        "of its numbers."
    )
    assert found == ("1 of 4 trials was not executed.", said)
    hot = Ending(Outcome.FAULT, "over-temperature")
    failed = (replace(t, ending=hot) if t.trial.number == 3 else t for t in run.trials)
    broken = replace(run, trials=tuple(failed))
    assert said in opening(made_up, tmp_path, run=broken, stabilization=told).wrong
    none = replace(run, trials=tuple(replace(t, ending=hot) for t in run.trials))
    assert said not in opening(made_up, tmp_path, run=none, stabilization=told).wrong


def test_instability_that_was_sought_is_no_failure(made_up: ModuleType, tmp_path: Path):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()})
    kinds = experiments(made_up, stabilization=says())
    kinds = {name: replace(each, seeks_instability=True) for name, each in kinds.items()}
    (told,) = document_of(run, kinds).opening.wrong
    assert told.startswith("1 trial of Stabilization ended early")
    assert "such an end is a result" in told
    hot = Ending(Outcome.FAULT, "over-temperature")
    run = replace(run, trials=(*run.trials[:3], replace(run.trials[3], ending=hot)))
    (told,) = document_of(run, kinds).opening.wrong
    assert told.startswith("1 of 4 executed trials did not complete")


@pytest.mark.parametrize(
    ("status", "reason", "said"),
    [
        (RunStatus.COMPLETE, "", None),
        (RunStatus.FAILED_TRIALS, "", None),
        (RunStatus.INTERRUPTED, "stopped by Ctrl-C", "The run was interrupted: stopped by Ctrl-C."),
        (RunStatus.FAULT, "no answer", "The run ended early, by a fault: no answer."),
        (
            RunStatus.INCOMPLETE,
            "",
            "The archive has no end of the run: it is in progress, or it was killed.",
        ),
    ],
)
def test_how_a_run_ended(
    made_up: ModuleType, tmp_path: Path, status: RunStatus, reason: str, said: str | None
):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    run = replace(run, status=status, reason=reason)
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.wrong == (() if said is None else (said,))


def test_what_was_not_executed_is_counted(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    run = replace(run, trials=run.trials[:1], status=RunStatus.INTERRUPTED)
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.wrong == ("The run was interrupted.", "3 of 4 trials were not executed.")


def test_a_test_without_any_trial_says_so(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    run = replace(run, trials=(), status=RunStatus.INTERRUPTED)
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.answers[0].problem == "none of its trials was executed"
    assert not any("No result" in each for each in found.wrong), "it is not executed, not failed"


def test_tests_without_trials_are_told_once_behind_the_cause(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    run = replace(run, trials=(), status=RunStatus.INTERRUPTED, reason="stopped by SIGTERM")
    tests = document_of(run, experiments(made_up, stabilization=says())).tests
    (told,) = without_trials(run, tests)
    assert told.startswith("The run was interrupted: stopped by SIGTERM. No trial of 1 test was")
    assert told.endswith(" executed: stabilization.")
    assert [*without_trials(run, ())] == []


def test_a_bench_that_nobody_saw_at_rest_is_told(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    unsafe = Ending(Outcome.COMPLETED, safe_state=SafeState.NOT_CONFIRMED)
    trials = (replace(run.trials[0], ending=unsafe), *run.trials[1:])
    run = replace(run, safe_state=SafeState.NOT_CONFIRMED, trials=trials)
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.wrong == (
        "Safe state NOT confirmed: the bench was not seen at rest, its drive off, at the end.",
        "After 1 trial the bench was not seen at rest with its drive off.",
    )


def test_damage_is_told(made_up: ModuleType, tmp_path: Path):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    damage = Damage.at("/trial_00004/data/gyro_rate", "does not match its checksum")
    run = replace(run, trials=run.trials[:3], damaged=(damage,))
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.wrong == (
        "1 trial was executed and cannot be read.",
        "The archive is damaged in 1 place: what cannot be read is in none of these numbers.",
    )


def test_that_nobody_knows_what_was_executed_is_no_word_of_what_was_not(
    made_up: ModuleType, tmp_path: Path
):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": ()}))
    damage = Damage.at("/run/journal", "is not a whole journal")
    run = replace(run, trials=(), damaged=(damage, Damage.at("/run/index/data", "is damaged")))
    found = opening(made_up, tmp_path, run=run, stabilization=says())
    assert found.answers[0].problem == "none of its trials can be read"
    assert found.wrong[0] == (
        "4 of 4 trials cannot be read, and the archive does not say any more whether they were "
        "executed."
    )
    assert not any("not executed" in each for each in found.wrong)


def test_an_analysis_that_failed_is_named_and_costs_nobody_else(
    made_up: ModuleType, tmp_path: Path
):
    run = completed(made_up.made_up_run(tmp_path, tests={"stabilization": (), "breakaway": ()}))
    found = opening(
        made_up,
        tmp_path,
        run=run,
        stabilization=says(ratio(2.9, 2.7, 3.1)),
        breakaway=made_up.broken,
    )
    assert found.wrong == ("No result of 1 of 2 tests: Breakaway.",)
    assert found.answers[0].numbers
    assert "no recording reached breakaway" in found.answers[1].problem


# Published values ---------------------------------------------------------------------------------


def test_published_values_take_part_in_one_sentence(made_up: ModuleType, tmp_path: Path):
    run = made_up.made_up_run(tmp_path)
    found = document_of(run, made_up.EXPERIMENTS)
    said, close = found.opening.compared.split(". Of ")
    counts = re.findall(r"\d+", said)
    assert int(counts[0]) == sum(int(each) for each in counts[2::2])
    assert "published values compared. Reproduced:" in said
    values = filter(is_compared, once(found.scoreboard.lines))
    sizes = [abs(line.deviation) for line in values if line.deviation is not None]
    within = [sum(size <= limit for size in sizes) for limit in (5, 10)]
    assert close == f"{len(sizes)} numbers, {within[0]} within 5 % and {within[1]} within 10 %."
    html = render(run, tmp_path, made_up.EXPERIMENTS, made_up.TEMPLATES)[0]
    assert '<a href="#scoreboard">' in _section(html)


OWN = """
source = "Our own paper"
[[table]]
name = "1"
title = "Ours"
quantity = "stabilization_error"
unit = "urad"
rows = { condition = "compensation" }
column.error = {}
[table.cells]
lugre = [500]
"""


def test_a_value_that_nobody_found_is_not_what_a_page_opens_with(
    made_up: ModuleType, tmp_path: Path
):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ("1",)}, published=OWN)
    kinds = experiments(made_up, stabilization=says(ratio(2.9, 2.7, 3.1)))
    html = render(run, tmp_path, kinds, made_up.TEMPLATES)[0]
    assert "No published number" not in _section(html)
    assert document_of(run, kinds).opening.compared == ""


@pytest.mark.parametrize("reproduces", [(), ("figure 4.8",), ("figure 5.4", "figure 5.9")])
def test_a_run_without_published_values_has_no_scoreboard(
    made_up: ModuleType, tmp_path: Path, reproduces: tuple[str, ...]
):
    """The made-up tests name figures of their own, too: none has printed numbers."""
    own = made_up.bench(name="ours", description="of our laboratory")
    run = made_up.made_up_run(tmp_path, tests={"stabilization": reproduces}, bench=own)
    kinds = experiments(made_up, stabilization=says(ratio(2.9, 2.7, 3.1)))
    html, folder, _ = render(run, tmp_path, kinds, made_up.TEMPLATES)
    assert "coreboard" not in html.partition("</style>")[2]
    assert "ublished" not in _section(html)
    assert "tables/scoreboard.csv" not in folder.files
    assert "on the bench ours, simulated" in _section(html)
    assert "2.90 ±\u00a00.20" in _section(html)


def test_a_title_that_speaks_of_hardware_says_that_it_was_simulated(
    made_up: ModuleType, tmp_path: Path
):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()}, title="Errors on the Hardware")
    (test,) = run.header.tests
    tests = ({**test, "title": "The error on the hardware"},)
    run = replace(run, header=run.header.model_copy(update={"tests": tests}))
    kinds = experiments(made_up, stabilization=says(ratio(2.9, 2.7, 3.1)))
    html = render(run, tmp_path, kinds, made_up.TEMPLATES)[0]
    assert "<h1>Errors on the Hardware (simulated)</h1>" in html
    assert "<title>Errors on the Hardware (simulated)</title>" in html
    assert html.count("The error on the hardware") == html.count("on the hardware (simulated)") > 2
    assert citation_of(run).sentence.startswith("Errors on the Hardware (simulated). Run")
    measured = replace(run, header=run.header.model_copy(update={"source": "hardware"}))
    html = render(measured, tmp_path, kinds, made_up.TEMPLATES)[0]
    assert "<h1>Errors on the Hardware</h1>" in html
    assert "(simulated)" not in html


# The figure on top --------------------------------------------------------------------------------


def _section(html: str) -> str:
    start = html.index('<section id="opening"')
    return html[start : html.index("</section>", start)]


def test_the_telling_figure_stands_on_top_and_nowhere_else(made_up: ModuleType, tmp_path: Path):
    told = says(figures=(figure("one"), figure("two"), figure("three")), telling="two")
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()})
    html = render(run, tmp_path, experiments(made_up, stabilization=told), made_up.TEMPLATES)[0]
    assert "Figure two" in _section(html)
    assert html.count("<figure id=") == 3
    anchor = re.search(r'<figure id="(figure-\d+)"', _section(html))
    assert anchor
    assert html.count(f'id="{anchor[1]}"') == 1
    rest = html.replace(_section(html), "")
    assert f'<a href="#{anchor[1]}">' in rest, "its section leads to it"
    assert rest.count("<figure id=") == 2


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        # Intervals go first, then how many numbers have one, then the protocol's order.
        ({"interval": False}, {"interval": True}, "velocity-map"),
        ({"interval": True}, {"interval": True}, "stabilization"),
        ({"interval": True}, {"interval": True, "ratios": [(1.4, None, None)]}, "stabilization"),
        ({"interval": True}, {"interval": True, "ratios": [(2.9, 2.7, 3.1)]}, "velocity-map"),
        ({"interval": True}, {"interval": False, "ratios": [(2.9, 2.7, 3.1)]}, "stabilization"),
    ],
)
def test_the_figure_that_tells_most_is_chosen(
    made_up: ModuleType, tmp_path: Path, one: dict, other: dict, expected: str
):
    def told(interval: bool, ratios: list = ()) -> Callable[[TestData], Result]:
        said = (ratio(*each) for each in ratios)
        return says(*said, figures=(figure("a", interval=interval),))

    found = opening(made_up, tmp_path, stabilization=told(**one), velocity_map=told(**other))
    assert found.telling == (expected, "a")


def test_a_key_of_no_figure_gives_the_first(made_up: ModuleType, tmp_path: Path):
    told = says(figures=(figure("one"), figure("two")), telling="three")
    assert opening(made_up, tmp_path, stabilization=told).telling == ("stabilization", "one")


# The truth ----------------------------------------------------------------------------------------


def test_what_is_true_is_counted_beside_what_was_found(made_up: ModuleType, tmp_path: Path):
    """The appendix' bench: 26 + 141.176 * 0.03 = 30.235 N m at the load, in either direction."""
    values = {"positive": (30.2, 30.1, 30.3), "negative": (30.6, 30.5, 30.7)}
    findings = tuple(
        Finding.of(
            Estimate("coulomb_torque", value, "N m", low, high, 0.95),
            {"direction": direction, "exponent": "free"},
        )
        for direction, (value, low, high) in values.items()
    )
    run = made_up.made_up_run(tmp_path, tests={"velocity_map": ()})
    found = opening(made_up, tmp_path, run=run, velocity_map=lambda data: Result(findings=findings))
    assert found.answers[0].truth == "1 of 2 intervals hold the true values of the simulated bench"
    html = render(
        run,
        tmp_path,
        experiments(made_up, velocity_map=lambda data: Result(findings=findings)),
        made_up.TEMPLATES,
    )[0]
    assert re.search(r'<a href="#table-\d+">1 of 2 intervals', html)
    assert "1 of 2 intervals hold the true values of the simulated bench." in _section(html)


def test_hostile_text_is_only_text(made_up: ModuleType, tmp_path: Path):
    hostile = "<script>alert(7)</script> {{ 7 * 7 }}"
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()})
    bad = Ending(Outcome.LIMIT, hostile)
    run = replace(run, trials=tuple(replace(each, ending=bad) for each in run.trials))
    kinds = experiments(
        made_up, stabilization=says(Finding.of(Estimate(hostile, 1.0, "rad", 0.9, 1.1, 0.95), {}))
    )
    report = made_up.build(run, tmp_path / "out", experiments=kinds)
    html = report.path.read_text(encoding="utf-8")
    assert html.count("<script") == 1, "the page's own"
    assert "{{ 7 * 7 }}" in _section(html)
