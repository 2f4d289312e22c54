"""The content of a report as data, common to all formats."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from campaign.api.analysis import (
    AnalysedTest,
    TestAnalysis,
    analyse_run,
    damage_of,
    published_of,
    run_title,
)
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import hidden_trials, lost_trials
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.sound_samples import readable
from campaign.experiments.interface import Experiment
from campaign.published.scoreboard import Scoreboard, score
from campaign.published.values import Published
from campaign.recording import Outcome
from campaign.report.content.first_screen import FirstScreen, opening_of
from campaign.report.content.held_values import held_tables
from campaign.report.content.incidents import Incidents, incidents
from campaign.report.content.references import Files, References, compared_with
from campaign.report.content.settings import tree_settings
from campaign.report.content.truth import truth_tables
from campaign.report.content.written_units import TestUnits, units_of
from campaign.result import Table

NO_FILES: Files = {}
FAILED = 200
"""Maximum number of listed failed trials; the archive has all."""
ANEW = "the program that made this page, whatever is archived"


@dataclass(frozen=True)
class Document:
    """Content of a report, independent of the page.

    Attributes:
        tests: in the protocol's order.
        units: display units by test.
        published: published values of the run's protocol, by table.
        truths: table of true values, or of compensation values, by test, if known.
        references: comparison of findings with bench files and files of reference values.
        damaged: damage of the run that the report detected.
        measured_by: program that computed the metrics of the recordings.
    """

    run: RunReader
    trials: tuple[ArchivedTrial, ...]
    tests: tuple[AnalysedTest, ...]
    units: Mapping[str, TestUnits]
    published: Published
    scoreboard: Scoreboard
    truths: Mapping[str, Table]
    references: References
    incidents: Incidents
    opening: FirstScreen
    damaged: tuple[Damage, ...]
    measured_by: str

    @property
    def title(self) -> str:
        return run_title(self.run)

    @property
    def command(self) -> str:
        """Command that repeats this run, in the folder of its protocol."""
        return shlex.join(_command_words(self.run))

    @property
    def backend(self) -> str:
        """Backend of the trials with its options, as text."""
        header = self.run.header
        options = (f"{name}: {text}" for name, text in tree_settings(header.backend_options))
        return ", ".join([header.backend or "not stated", *options])

    @property
    def seeds(self) -> str:
        """Seeds of the trials as a short text."""
        seeds = sorted({trial.trial.seed for trial in self.trials})
        if len(seeds) <= 4:
            return ", ".join(str(seed) for seed in seeds)
        return f"{len(seeds)} seeds from {seeds[0]} to {seeds[-1]}, one per trial in the archive"

    @property
    def sources(self) -> tuple[str, ...]:
        """Source documents of the compared published values."""
        documents = (self.published[name].source for name in self.scoreboard.tables())
        return tuple(dict.fromkeys(documents))

    @property
    def failed(self) -> tuple[ArchivedTrial, ...]:
        """The executed trials that did not complete."""
        return tuple(each for each in self.trials if each.ending.outcome is not Outcome.COMPLETED)

    @property
    def lost(self) -> int:
        """Number of trials that cannot be read: executed ones, and ones that perhaps were."""
        return len(lost_trials(self.run)) + hidden_trials(self.run)

    @property
    def not_executed(self) -> int:
        """Number of planned trials that were not executed."""
        return max(0, len(self.run.plan) - len(self.trials) - self.lost)


def document_of(
    run: RunReader,
    experiments: Mapping[str, Experiment],
    *,
    measure_anew: bool = False,
    found: Mapping[str, TestAnalysis] | None = None,
    shown: Collection[int] = (),
    files: Files = NO_FILES,
) -> Document:
    """Analyse a run and collect the content of its report.

    `measure_anew`, `found`: as for `analyse_run`. `shown`: trials with a page of their own, which
    needs all samples. `files`: files of reference values.
    """
    trials = tuple(run.trials)  # kept, because a page reads them often
    happened = incidents(run)  # before the wait for analyses
    published = published_of(run)
    tests = analyse_run(run, experiments, measure_anew=measure_anew, found=found)
    _, of_pages = readable(run.path, [t for t in trials if t.trial.number in shown])
    damaged = tuple(dict.fromkeys((*damage_of(run, tests), *happened.damaged, *of_pages)))
    scoreboard = score(published, [test.evidence() for test in tests])
    units = units_of(tests, run.header)
    truths = {**held_tables(run, tests, published), **truth_tables(run, tests, units)}
    references = compared_with(run, tests, units, files)
    return Document(
        run,
        trials,
        tests,
        units,
        published,
        scoreboard,
        truths,
        references,
        happened,
        opening_of(run, tests, units, scoreboard, truths, references, damaged),
        damaged,
        ANEW if measure_anew else _measured_by(trials),
    )


def _measured_by(trials: Iterable[ArchivedTrial]) -> str:
    """Program that computed the metrics of the recordings during the run."""
    return "; ".join(sorted({trial.measured_by for trial in trials if trial.measured_by}))


def _command_words(run: RunReader) -> Iterator[str]:
    header = run.header
    imported = header.backend == "import"
    command = "import" if imported else "run"
    yield from ("campaign", command, f"{header.protocol_name or 'protocol'}.toml")
    if header.backend and header.backend != "sim" and not imported:
        yield from ("--backend", header.backend)
    for test in header.only:
        yield from ("--only", test)
    if header.truth.option:
        yield from ("--truth", Path(header.truth.option).name)
    for path, value in sorted(header.overrides.items()):
        yield from ("--set", f"{path}={value}")
