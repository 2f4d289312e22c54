"""The report: one self-contained page, its tables and its figures, from an archived run alone."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.archive import ArchivedTrial, RunReader
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import listed, lost_trials
from campaign.errors import UsageError
from campaign.experiments.interface import Experiment
from campaign.plain_text import on_a_page
from campaign.published.scoreboard import Scoreboard, score
from campaign.report import lines, page, tables
from campaign.report.analysis import analyse_run, one_line, published_of
from campaign.report.besides import besides
from campaign.report.damage_notice import told_on_page
from campaign.report.output import replaced_folder
from campaign.report.palette import variables
from campaign.report.truth import truth_tables
from campaign.trial import Outcome

FAILED = 200
"""Most failed trials that are listed; the archive has them all."""
ANEW = "the program that made this page, whatever is archived"
DAMAGED = 200
"""Most damage that is listed on the page; `tables/damaged.csv` has all."""


@dataclass(frozen=True)
class Report:
    """A finished report.

    Attributes:
        path: of `report.html`.
        problems: analyses that failed and numbers that could not be compared, one line each.
        damaged: what of the run is damaged, as far as the report looked at it; all else is there.
    """

    path: Path
    problems: tuple[str, ...]
    damaged: tuple[Damage, ...] = ()


def build_report(
    run: RunReader,
    output: Path,
    *,
    experiments: Mapping[str, Experiment],
    packaged_templates: Path,
    templates: Path | None = None,
    measure_anew: bool = False,
) -> Report:
    """Write `report.html`, `tables/` and `figures/` of `run` into the folder `output`.

    The same archive gives the same bytes. A template in `templates` wins over the packaged one of
    the same name. `measure_anew`: as for `analyse_run`.

    Raises UsageError when `output` is no report of ours or cannot be written, or when a template is
    wrong; an older report is then left as it was.
    """
    html, folder, report = render(
        run, output, experiments, packaged_templates, templates, measure_anew
    )
    with replaced_folder(output) as new:
        for name, text in {"report.html": html, **folder.files}.items():
            path = new / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(on_a_page(text), encoding="utf-8", newline="\n")
    return report


def render(
    run: RunReader,
    output: Path,
    experiments: Mapping[str, Experiment],
    packaged_templates: Path,
    templates: Path | None = None,
    measure_anew: bool = False,
) -> tuple[str, page.Folder, Report]:
    """The page's text, the other files, and what there is to say of them; nothing is written."""
    published = published_of(run)
    tests = analyse_run(run, experiments, measure_anew=measure_anew)
    scoreboard = score(published, [test.evidence() for test in tests])
    folder = page.Folder()
    download = page.scoreboard_download(scoreboard, folder)
    picture = page.overview(scoreboard, folder)
    strips = page.strips(scoreboard, folder)
    truths = truth_tables(run, tests)
    sections = page.lay_out(tests, scoreboard, published, folder, truths)
    happened = besides(run, folder)
    found = [damage for test in tests for damage in test.damaged]
    damaged = tuple(dict.fromkeys((*run.damaged, *found, *happened.damaged)))
    problems = (
        *(f"{s.test.name}: {p}" for s in sections for p in s.problems if p not in s.left_out),
        *scoreboard.problems,
        *happened.problems,
    )
    context = {
        "run": run,
        "header": run.header,
        "colours": variables(),
        "agreement": tables.agreement(scoreboard),
        "picture": picture,
        "strips": strips,
        "scoreboard": [lines.shown_line(line) for line in scoreboard.lines],
        "scoreboard_download": download,
        "statuses": lines.statuses(scoreboard),
        "altered": scoreboard.altered,
        "sections": sections,
        "besides": happened,
        "anchors": page.anchors(sections),
        "failed": _failed(run.trials),
        "failed_count": sum(t.ending.outcome is not Outcome.COMPLETED for t in run.trials),
        "contradictions": lines.contradictions(scoreboard),
        "sources": _sources_of(scoreboard, published),
        "problems": (*(f"damaged: {line}" for line in listed(damaged, DAMAGED)), *problems),
        "damage": told_on_page(run, damaged, folder) if damaged else None,
        "command": _command(run),
        "seeds": _seeds(run.trials),
        "measured_by": ANEW if measure_anew else _measured_by(run.trials),
        "lost": len(lost_trials(run)),
        "not_executed": max(0, len(run.plan) - len(run.trials) - len(lost_trials(run))),
    }
    html = _fill(context, packaged_templates, templates)
    return html, folder, Report(output / "report.html", problems, damaged)


def _fill(context: Mapping[str, Any], packaged: Path, own: Path | None) -> str:
    """The page from its templates: autoescaped, and an unknown name is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError

    if own is not None and not own.is_dir():
        raise UsageError(f"{own}: is no folder of templates")
    folders = [str(folder) for folder in (own, packaged) if folder is not None]
    environment = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    try:
        return environment.get_template("report.html").render(context) + "\n"
    except TemplateError as error:
        place = f"{getattr(error, 'name', None) or 'report.html'}:{getattr(error, 'lineno', '?')}"
        raise UsageError(f"template {place.removesuffix(':?')}: {one_line(error)}") from None


def _failed(trials: tuple[ArchivedTrial, ...]) -> tuple[ArchivedTrial, ...]:
    failed = (trial for trial in trials if trial.ending.outcome is not Outcome.COMPLETED)
    return tuple(trial for trial, _ in zip(failed, range(FAILED), strict=False))


def _sources_of(scoreboard: Scoreboard, published: Mapping[str, Any]) -> tuple[str, ...]:
    """The documents whose numbers are on the page."""
    return tuple(dict.fromkeys(published[name].source for name in scoreboard.tables()))


def _seeds(trials: tuple[ArchivedTrial, ...]) -> str:
    seeds = sorted({trial.trial.seed for trial in trials})
    if len(seeds) <= 4:
        return ", ".join(str(seed) for seed in seeds)
    return f"{len(seeds)} seeds from {seeds[0]} to {seeds[-1]}, one per trial in the archive"


def _measured_by(trials: tuple[ArchivedTrial, ...]) -> str:
    """Whose code found what each recording says by itself, when it was executed."""
    return "; ".join(sorted({trial.measured_by for trial in trials if trial.measured_by}))


def _command(run: RunReader) -> str:
    """What repeats this run, where its protocol lies."""
    return shlex.join(_command_words(run))


def _command_words(run: RunReader) -> Iterator[str]:
    header = run.header
    yield from ("campaign", "run", f"{header.protocol_name or 'protocol'}.toml")
    if header.backend and header.backend != "sim":
        yield from ("--backend", header.backend)
    for test in header.only:
        yield from ("--only", test)
    if header.truth.option:
        yield from ("--truth", Path(header.truth.option).name)
    for path, value in sorted(header.overrides.items()):
        yield from ("--set", f"{path}={value}")
