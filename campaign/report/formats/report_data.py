"""The data of `report.json`: every number unrounded.

The JSON Schema in `docs/report.schema.json` is made from these; `docs/results-as-data.md` explains.
Numbers are SI unless something else is said; one that is not finite is null.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, JsonValue

from campaign.report.content.first_screen import FirstScreen

FORMAT = 3
"""Rises when a field changes its meaning or goes; a new one may come at any time."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Number(_Part):
    """A number that was found, or why it was not."""

    quantity: str
    """What it is, e.g. `coulomb_torque`."""
    value: float | None
    """SI, in `unit`; null when it is not determined."""
    unit: str
    low: float | None
    """Lower end of the interval as the page shows it, systematic parts included; null where it is
    open or there is none. Of a bound, the only end there is."""
    high: float | None
    """Its upper end."""
    scatter_low: float | None
    """Lower end of the interval that scatter alone leaves."""
    scatter_high: float | None
    level: float | None
    """The share of repetitions in which such an interval holds the truth."""
    standard_error: float | None
    """One sigma."""
    freedom: float | None
    """Degrees of freedom behind it."""
    origin: str
    """`measured`, `assumed`, `given`, `at its bound` or `not determined`."""
    kind: str
    """`number`, `share`, `count`, `quantile`, `at least` or `at most`."""
    reason: str
    """Why it has no interval, or no value."""
    reason_code: str
    """Which reason that is: the same for all of its kind; "" for none."""
    reason_values: dict[str, JsonValue]
    """What `reason` has in it, by name (SI, or a percentage called so)."""
    method: str
    systematic: dict[str, float | None]
    """What repetitions do not show: source to standard uncertainty, null where nobody knows it."""


class Finding(_Part):
    """A number that a test found, under its conditions (SI)."""

    number: Number
    conditions: dict[str, JsonValue]
    recomputed: bool
    """Derived from other published numbers rather than from a recording."""


class Column(_Part):
    """A column of a table."""

    name: str
    label: str
    unit: str
    """Of the numbers here (SI)."""
    display: str
    """Unit on the page, and in the CSV file."""
    factor: float
    """What a number here is multiplied by to be in `display`."""
    exact: bool
    """What it holds was set or counted."""
    reason: str
    """Why its numbers have no interval."""


class Table(_Part):
    """A table of the page; rows have a value, or a number with its interval, by column."""

    key: str
    title: str
    place: int
    """Its number on the page."""
    anchor: str
    file: str
    """The CSV file."""
    note: str
    remarks: tuple[str, ...]
    """Which of its numbers have no interval or are not determined, and why."""
    published: tuple[str, ...]
    """Published tables it stands for."""
    columns: tuple[Column, ...]
    rows: tuple[dict[str, Number | float | int | str | bool | None], ...]


class Axis(_Part):
    """An axis: `unit` is that of the numbers here (SI), `display` that of the drawing."""

    label: str
    unit: str
    display: str
    factor: float
    scale: str
    limits: tuple[float | None, float | None] | None


class Curve(_Part):
    """A curve as it is drawn: all of its points, or so many that the picture is the same."""

    label: str
    series: str
    style: str
    points: int
    """How many it has; all are in `RUN-results.nxs`."""
    x: tuple[float | None, ...]
    """Seven digits, as are all numbers of a curve."""
    y: tuple[float | None, ...]
    low: tuple[float | None, ...] | None
    """Lower end of the 95 % interval of y."""
    high: tuple[float | None, ...] | None
    lower_edge: tuple[float | None, ...] | None
    """Of a band, whose upper edge is y."""


class Mark(_Part):
    """A labelled position in a panel, in the units of its axes."""

    label: str
    x: float | None
    y: float | None
    until: float | None


class Panel(_Part):
    """One set of axes."""

    title: str
    x: Axis
    y: Axis
    curves: tuple[Curve, ...]
    marks: tuple[Mark, ...]


class Figure(_Part):
    """A figure of the page."""

    key: str
    title: str
    place: int
    """Its number on the page."""
    anchor: str
    file: str
    """The SVG file."""
    caption: str
    published: tuple[str, ...]
    trials: tuple[int, ...]
    """Those that it shows, as the page says; empty where it says none."""
    panels: tuple[Panel, ...]
    """Empty for a picture of what is in `scoreboard`, `prediction` or `references`."""


class Comparison(_Part):
    """A published table beside what was found: the lines of the scoreboard with its name."""

    table: str
    heading: str
    title: str
    place: int
    anchor: str
    file: str


class Said(_Part):
    """A fact as the page says it."""

    name: str
    text: str


class Test(_Part):
    """One test: what it is, what it comes to, and all that it found."""

    __test__ = False  # it is not one of pytest's

    name: str
    kind: str
    title: str
    description: str
    anchor: str
    reproduces: tuple[str, ...]
    problems: tuple[str, ...]
    trials: tuple[int, ...]
    """The executed ones that could be read."""
    options: dict[str, JsonValue]
    """Normalised (SI), before the sweep."""
    conditions: tuple[Said, ...]
    key_numbers: tuple[Finding, ...]
    """What was asked for, the most important first: `findings`, or medians of draws."""
    notes: tuple[str, ...]
    findings: tuple[Finding, ...]
    comparisons: tuple[Comparison, ...]
    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]
    truth: Table | None
    """What it found beside what is true, where that is known."""
    prediction: Table | None
    """What it found beside what its bench file states, where that is tested."""
    references: tuple[Table, ...]
    """What it found beside each file of reference values."""


class Line(_Part):
    """A published number beside what was found, both in the unit that it is printed in."""

    table: str
    row: str
    column: str
    cell: str
    """The same in words."""
    unit: str
    published: float | None
    printed: str
    relation: str
    """`equal`, `near`, `at most`, `at least` or `rank`: what the document claims."""
    reproduced: float | None
    low: float | None
    high: float | None
    kind: str
    """Of what was found; `at least` and `at most` are bounds. "" where nothing was."""
    deviation_percent: float | None
    verdict: str
    status: str
    test: str
    source: str
    notes: tuple[str, ...]
    draws: tuple[float | None, ...]
    """What each draw of a random bench found."""
    place: Number | None
    """The share of the draws that lie below the published number."""


class Count(_Part):
    """How many published numbers of one status were compared, and how many hold."""

    status: str
    compared: int
    good: int
    numbers: int
    """Of which a deviation in percent means something."""
    within_percent: dict[str, int]
    """How many of these deviate by no more than so many percent."""


class Contradiction(_Part):
    """Cells of a published table that cannot all be right."""

    table: str
    cells: tuple[str, ...]
    reason: str


class Scoreboard(_Part):
    """Published values beside what was found; `further` were found again and do not count."""

    agreement: str
    """What it all comes to, in words."""
    counts: tuple[Count, ...]
    """Each published number once, however often it is printed."""
    closeness: Table | None
    """The counts as the page shows them."""
    not_reached: int
    not_found: int
    not_run: int
    lines: tuple[Line, ...]
    further: tuple[Line, ...]
    statuses: dict[str, int]
    """How many lines have which status."""
    sources: tuple[str, ...]
    altered: tuple[str, ...]
    contradictions: tuple[Contradiction, ...]
    figures: tuple[Figure, ...]
    file: str
    """The CSV file; "" without any lines."""


class FailedTrial(_Part):
    """A trial that did not complete."""

    number: int
    label: str
    outcome: str
    reason: str
    safe_state: str


class Run(_Part):
    """The run that the report is of."""

    name: str
    file: str
    title: str
    description: str
    created: str
    ended: str
    status: str
    reason: str
    safe_state: str
    backend: str
    source: str
    operator: str
    notes: str
    tags: tuple[str, ...]
    planned: int
    executed: int
    not_completed: int
    not_readable: int
    not_executed: int


class Provenance(_Part):
    """What the run is, and what this was made by, in digests and versions."""

    sha256: str
    """Of the archive's file as `sha256sum` prints it; of a run in progress, of its journal."""
    seal: str
    """The digest that stands for all of the run; "" where there is none."""
    fingerprint: str
    """Of the normalised protocol."""
    command: str
    """What repeats the run."""
    seeds: str
    git_revision: str
    backend_options: dict[str, JsonValue]
    overrides: dict[str, str]
    only: tuple[str, ...]
    versions: dict[str, str]
    """When it was executed."""
    plugins: tuple[dict[str, JsonValue], ...]
    host: dict[str, str]
    measured_by: str
    truths: tuple[str, ...]
    """Names of the benches that were simulated in place of the stated ones."""
    sources: dict[str, str]
    """Protocol and benches, verbatim."""
    truth_sources: dict[str, str]
    program: str
    """The version of campaign that made the report."""
    code: str
    """Hash of the sources that analysed."""


class Incidents(_Part):
    """What happened besides the plan."""

    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]


class Section(_Part):
    """A section of a page that is no report."""

    anchor: str
    heading: str
    sentences: tuple[str, ...] = ()
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()


class ArticleData(_Part):
    """A comparison, trends or an identification; figures and tables are those of a report."""

    format: int = FORMAT
    kind: str
    program: str
    command: str
    title: str
    facts: tuple[tuple[Said, ...], ...]
    sections: tuple[Section, ...]
    content: dict[str, JsonValue]
    """What only this kind of page has."""


class ReportData(_Part):
    """A whole report."""

    format: int = FORMAT
    run: Run
    opening: FirstScreen
    """As on top of the page; its numbers are in the tests' `key_numbers`."""
    scoreboard: Scoreboard
    tests: tuple[Test, ...]
    incidents: Incidents
    failed: tuple[FailedTrial, ...]
    problems: tuple[str, ...]
    damaged: tuple[str, ...]
    provenance: Provenance
