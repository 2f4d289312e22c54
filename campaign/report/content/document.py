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
from campaign.archive import ArchivedTrial, RunReader
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import hidden_trials, lost_trials
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
from campaign.result import Table

NO_FILES: Files = {}
ANEW = "the program that made this page, whatever is archived"


@dataclass(frozen=True)
class Document:
    """What a report says; nothing in it knows a page.

    Attributes:
        tests: in the protocol's order.
        published: the values that the run's protocol compares with, by table.
        truths: by test, what is true beside what it found, or what its compensations hold, where
            that is known.
        references: what bench files, and files of reference values, state of what was found.
        damaged: what of the run is damaged, as far as the report looked at it.
        measured_by: whose code found what each recording says by itself.
    """

    run: RunReader
    trials: tuple[ArchivedTrial, ...]
    tests: tuple[AnalysedTest, ...]
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
        """What repeats this run, where its protocol lies."""
        return shlex.join(_command_words(self.run))

    @property
    def backend(self) -> str:
        """What executed the trials, and the options that it had, in words."""
        header = self.run.header
        options = (f"{name}: {text}" for name, text in tree_settings(header.backend_options))
        return ", ".join([header.backend or "not stated", *options])

    @property
    def seeds(self) -> str:
        """The seeds of its trials, in a few words."""
        seeds = sorted({trial.trial.seed for trial in self.trials})
        if len(seeds) <= 4:
            return ", ".join(str(seed) for seed in seeds)
        return f"{len(seeds)} seeds from {seeds[0]} to {seeds[-1]}, one per trial in the archive"

    @property
    def sources(self) -> tuple[str, ...]:
        """The documents whose numbers are compared with."""
        found = (self.published[name].source for name in self.scoreboard.tables())
        return tuple(dict.fromkeys(found))

    @property
    def failed(self) -> tuple[ArchivedTrial, ...]:
        """The executed trials that did not complete."""
        return tuple(each for each in self.trials if each.ending.outcome is not Outcome.COMPLETED)

    @property
    def lost(self) -> int:
        """How many trials cannot be read: they were executed, or nobody knows whether they were."""
        return len(lost_trials(self.run)) + hidden_trials(self.run)

    @property
    def not_executed(self) -> int:
        """How many planned trials were not executed."""
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
    """Analyse a run and say what there is to say of it.

    `measure_anew`, `found`: as for `analyse_run`. `shown`: trials that have pages of their own,
    with all of their samples. `files`: of reference values.
    """
    trials = tuple(run.trials)  # held: a page asks for them in many places
    happened = incidents(run)  # before what is found is waited for
    published = published_of(run)
    tests = analyse_run(run, experiments, measure_anew=measure_anew, found=found)
    _, of_pages = readable(run.path, [t for t in trials if t.trial.number in shown])
    damaged = tuple(dict.fromkeys((*damage_of(run, tests), *happened.damaged, *of_pages)))
    scoreboard = score(published, [test.evidence() for test in tests])
    truths = {**held_tables(run, tests, published), **truth_tables(run, tests)}
    references = compared_with(run, tests, files)
    return Document(
        run,
        trials,
        tests,
        published,
        scoreboard,
        truths,
        references,
        happened,
        opening_of(run, tests, scoreboard, truths, references, damaged),
        damaged,
        ANEW if measure_anew else _measured_by(trials),
    )


def _measured_by(trials: Iterable[ArchivedTrial]) -> str:
    """Whose code found what each recording says by itself, when it was executed."""
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
