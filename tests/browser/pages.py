"""The pages that a browser is shown: a usual one, a hostile one, a damaged one, a long one.

And one of an identification, which has a table of more columns than any report.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.writer import RunWriter
from campaign.cli.identify import identify_run
from campaign.cli.import_command import import_recordings
from campaign.experiments.interface import Experiment, TestData
from campaign.recording import ChannelInfo, Ending, Outcome
from campaign.report.build import build_report
from campaign.result import Axis, Column, Curve, Figure, Mark, Panel, Result, Table
from tests.estimation.rigs import random_rigs
from tests.identify import conftest as rig_files
from tests.report import made_up

WORD = "W" * 10_000
"""One word of 10 kB: nothing to break it at."""
HOSTILE = (
    "<script>hacked = 1</script>"
    " \"><img src=x onerror='hacked = 1'>"
    " </title></style></script></textarea><svg onload='hacked = 1'>"
    " ' onmouseover='hacked = 1"
    " {{ 7 * 7 }} ${7 * 7} &lt;b&gt; &#x27;"
    " \u202eright to left\u202c \u200f\u2067turned"
)
"""Text that would run, break out of an attribute, or turn the line, were it not only text."""
SHORT = "<script>hacked = 1</script>"
"""For what is drawn: longer labels leave a drawing no room."""
LINK = "javascript:hacked=1"
ROWS = 300
FIGURES = 40


def usual(folder: Path) -> Path:
    """The made-up run."""
    return _report(made_up.made_up_run(folder), folder, made_up.EXPERIMENTS)


def interactive(folder: Path) -> Path:
    """The made-up run with figures that zoom."""
    return _report(made_up.made_up_run(folder), folder, made_up.EXPERIMENTS, zoom=True)


def hostile(folder: Path, *, zoom: bool = False) -> Path:
    """Hostile text in every field that somebody can fill."""
    text = f"{HOSTILE} {LINK} {WORD}"
    kinds = ("stabilization", "velocity_map")
    tests = tuple(
        {
            "name": f"{kind} {text}",
            "kind": kind,
            "title": f"{kind} {text}",
            "description": text,
            "reproduces": ["1"],
            "options": {text: text, "frequency": 0.24},
        }
        for kind in kinds
    )
    run = made_up.made_up_run(
        folder,
        tests=dict.fromkeys(kinds, ("1",)),
        published=_published(f"{HOSTILE} {LINK}"),
        title=text,
        description=text,
        operator=text,
        notes=text,
        tags=(text, LINK),
        host={f"host {text}": text},
        versions={text: text},
        backend=text,
        backend_options={text: text},
        protocol_name=text,
    )
    header = run.header.model_copy(
        update={"tests": tests, "sources": {**run.header.sources, text: text}}
    )
    trials = tuple(_with_text(each, text) for each in run.trials)
    run = dataclasses.replace(run, header=header, reason=text, trials=trials)
    kind = made_up.EXPERIMENTS["stabilization"]
    experiments = {
        "stabilization": dataclasses.replace(kind, analyse=_hostile_result),
        "velocity_map": dataclasses.replace(kind, analyse=_hostile_end),
    }
    return _report(run, folder, experiments, zoom=zoom)


def hostile_interactive(folder: Path) -> Path:
    """The same, whose figures zoom."""
    return hostile(folder, zoom=True)


def _with_text(archived: ArchivedTrial, text: str) -> ArchivedTrial:
    named = {"test": f"{archived.trial.kind} {text}", "label": text, "point": {text: text}}
    ending = archived.ending
    if ending.outcome is not Outcome.COMPLETED:
        ending = dataclasses.replace(ending, reason=text)
    return dataclasses.replace(
        archived, trial=archived.trial.model_copy(update=named), ending=ending
    )


def _hostile_result(data: TestData) -> Result:
    text = f"{HOSTILE} {LINK}"
    x = np.linspace(0.0, 1.0, 200)
    axis = Axis(SHORT, SHORT)
    curves = [Curve(x, x, SHORT, text), Curve(x, -x, LINK, LINK)]
    panel = Panel(axis, axis, curves, SHORT, [Mark(SHORT, x=0.5)])
    figure = Figure(text, f"{text} {WORD}", f"{text} {WORD}", text, (panel,), (text,))
    table = Table(
        text,
        f"{text} {WORD}",
        (Column(text, text, text), Column("b", f"{text} {WORD}", LINK, reason=text)),
        ({text: text, "b": LINK}, {text: 1.0, "b": WORD}, {text: WORD, "b": text}),
        (text,),
        f"{text} {WORD}",
    )
    return Result((table,), (figure,), (), (text, LINK, WORD))


def _hostile_end(data: TestData) -> Result:
    raise ValueError(f"{HOSTILE} {LINK} {WORD}")


def _published(text: str) -> str:
    quoted = '"' + "".join(f"\\u{ord(c):04x}" for c in text) + '"'
    return f"""
source = {quoted}
[[table]]
name = "1"
title = {quoted}
quantity = "stabilization_error"
unit = "urad"
rows = {{ condition = "compensation" }}
column.error = {{}}
[table.cells]
none = [500]
"""


def damaged(folder: Path) -> Path:
    """A run of three trials, of which the samples of one were changed on the disk."""
    bench = made_up.bench()
    trials = [made_up.trial(number, "velocity_map", bench) for number in (1, 2, 3)]
    header = RunHeader(
        name="run",
        created="2026-11-21T09:36:58Z",
        tests=({"name": "velocity-map", "kind": "velocity_map", "title": "Velocity map"},),
    )
    writer = RunWriter.create(folder / "results", header, trials)
    for trial in trials:
        recorder = writer.begin(trial)
        recorder.start((ChannelInfo("gyro_rate", "rad/s", "Rate", "deg/s"),))
        recorder.append(np.arange(100) / 100.0, np.full((1, 100), float(trial.number)))
        recorder.finish(Ending(Outcome.COMPLETED), "2026-11-21T09:37:00Z", "2026-11-21T09:37:01Z")
    path = writer.seal(RunStatus.COMPLETE, ended="2026-11-21T09:40:00Z")
    with h5py.File(path, "r+") as file:
        file["trial_00002/data/gyro_rate"][7] = 0.0

    def analyse(data: TestData) -> Result:
        for trial in data.trials:
            trial.recording()
        return made_up.velocity_map(data)

    kind = dataclasses.replace(made_up.EXPERIMENTS["velocity_map"], analyse=analyse)
    return _report(open_run(path), folder, {"velocity_map": kind})


def long(folder: Path) -> Path:
    """Eight tests with five figures each, and a table of 300 rows."""
    tests = {f"test_{place}": ("5.8",) for place in range(8)}
    experiments = {
        kind: Experiment(kind, kind, made_up.ShakeOptions, lambda options, bench: (), _long_result)
        for kind in tests
    }
    return _report(made_up.made_up_run(folder, tests=tests), folder, experiments)


def _long_result(data: TestData) -> Result:
    place = int(data.trials[0].trial.kind.removeprefix("test_"))
    numbers = range(FIGURES // 8 * place, FIGURES // 8 * (place + 1))
    figures = tuple(_long_figure(number) for number in numbers)
    tables = (_long_table(),) if place == 3 else ()
    return Result(tables, figures, (), ())


def _long_figure(number: int) -> Figure:
    """Its first and its last text can be told from those of any other figure."""
    x = np.linspace(0.0, 8.0, 60)
    rate = Axis("Rate", "rad/s", "deg/s")
    panels = tuple(
        Panel(
            Axis(f"Time{number}x{row}", "s", "s"),
            rate,
            [Curve(x, np.sin(x * (row + 1) + number), "none", "none")],
            f"Panel{number}x{row}",
        )
        for row in range(1 + number % 3)
    )
    return Figure(f"swing-{number}", f"Swing{number}", f"Caption{number}.", "A sine.", panels)


def _long_table() -> Table:
    columns = (Column("n", "Trial", exact=True), Column("error", "Error", "rad", "mrad"))
    rows = tuple({"n": n, "error": 1e-3 * (n + 0.5)} for n in range(ROWS))
    return Table("all", "Error of every trial", columns, rows)


def _report(
    run: RunReader, folder: Path, experiments: dict[str, Experiment], *, zoom: bool = False
) -> Path:
    report = build_report(
        run,
        folder / "report",
        experiments=experiments,
        packaged_templates=made_up.TEMPLATES,
        zoom=zoom,
    )
    return report.path


def identification(folder: Path) -> Path:
    """Of a rig that was made up: some methods find much of it, and others nothing."""
    made = folder / "made"
    made.mkdir()
    rig = random_rigs(3, seed=4, seconds=15.0)[1]
    (made / "rig.toml").write_text(rig_files.RIG, encoding="utf-8")
    rig_files.write(made / "monday.csv", rig, slice(None))
    mapping = rig_files.MAPPING + rig_files.TEST.format(name="monday")
    (made / "mapping.toml").write_text(mapping, encoding="utf-8")
    import_recordings([str(made / "mapping.toml")], made)
    run = next(made.glob("*.nxs")).stem
    methods = ("friction_map", "inverse_dynamics", "presliding")
    page, _ = identify_run(run, made, models=methods, page=folder / "report")
    return page.rename(page.with_name("report.html"))


PAGES: dict[str, Callable[[Path], Path]] = {
    "usual": usual,
    "hostile": hostile,
    "damaged": damaged,
    "long": long,
    "interactive": interactive,
    "identification": identification,
}
"""What every page must be, each of these is."""
MADE = {**PAGES, "hostile-interactive": hostile_interactive}
