"""Data of `report.json`, with unrounded numbers.

The JSON Schema in `docs/report.schema.json` is made from these; `docs/results-as-data.md` explains.
Numbers are SI unless stated otherwise; a number that is not finite is null.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, JsonValue

from campaign.report.content.first_screen import FirstScreen

FORMAT = 3
"""Increases if a field changes its meaning or is removed, not if one is added."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Number(_Part):
    """A number, or the reason for its absence."""

    quantity: str
    """Its name, e.g. `coulomb_torque`."""
    value: float | None
    """SI, in `unit`; null if not determined."""
    unit: str
    low: float | None
    """Lower end of the interval on the page, systematic parts included; null if open or absent. A
    bound has only one end."""
    high: float | None
    """Upper end."""
    scatter_low: float | None
    """Lower end of the interval from scatter alone."""
    scatter_high: float | None
    level: float | None
    """Share of repetitions whose interval contains the true value."""
    standard_error: float | None
    """One sigma."""
    freedom: float | None
    """Degrees of freedom."""
    origin: str
    """`measured`, `assumed`, `given`, `at its bound` or `not determined`."""
    kind: str
    """`number`, `share`, `count`, `quantile`, `at least` or `at most`."""
    reason: str
    """Reason for no interval or no value."""
    reason_code: str
    """Code of the reason, equal for all of its kind; "" for none."""
    reason_values: dict[str, JsonValue]
    """Values in `reason` by name (SI, or a percentage named so)."""
    method: str
    systematic: dict[str, float | None]
    """Not visible in repetitions: source to standard uncertainty; null if unknown."""


class Finding(_Part):
    """A result of a test, with its conditions (SI)."""

    number: Number
    conditions: dict[str, JsonValue]
    recomputed: bool
    """Derived from other published numbers, not from a recording."""


class Column(_Part):
    """A column of a table."""

    name: str
    label: str
    unit: str
    """Unit of its values (SI)."""
    display: str
    """Unit on the page, and in the CSV file."""
    factor: float
    """Converts its values from `unit` to `display`."""
    exact: bool
    """Its values were set or counted."""
    reason: str
    """Why its values have no interval."""


class Table(_Part):
    """A table of the page; a row has a value, or a number with interval, by column."""

    key: str
    title: str
    place: int
    """Its number on the page."""
    anchor: str
    file: str
    """The CSV file."""
    note: str
    remarks: tuple[str, ...]
    """Numbers without an interval or value, with reasons."""
    published: tuple[str, ...]
    """Corresponding published tables."""
    columns: tuple[Column, ...]
    rows: tuple[dict[str, Number | float | int | str | bool | None], ...]


class Axis(_Part):
    """An axis: `unit` of the values (SI), `display` of the drawing."""

    label: str
    unit: str
    display: str
    factor: float
    scale: str
    limits: tuple[float | None, float | None] | None


class Curve(_Part):
    """A curve as drawn: all points, or enough for the same picture."""

    label: str
    series: str
    style: str
    points: int
    """Number of its points; all are in `RUN-results.nxs`."""
    x: tuple[float | None, ...]
    """Seven digits, as all numbers of a curve."""
    y: tuple[float | None, ...]
    low: tuple[float | None, ...] | None
    """Lower end of the 95 % interval of y."""
    high: tuple[float | None, ...] | None
    lower_edge: tuple[float | None, ...] | None
    """Lower edge of a band; y is the upper."""


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
    """Shown trials, as stated on the page; empty if not stated."""
    panels: tuple[Panel, ...]
    """Empty for a figure of `scoreboard`, `prediction` or `references`."""


class Comparison(_Part):
    """A published table beside the results: the lines of the scoreboard with its name."""

    table: str
    heading: str
    title: str
    place: int
    anchor: str
    file: str


class Said(_Part):
    """A fact as on the page."""

    name: str
    text: str


class Test(_Part):
    """One test: description, key numbers and all results."""

    __test__ = False  # it is not one of pytest's

    name: str
    kind: str
    title: str
    description: str
    anchor: str
    reproduces: tuple[str, ...]
    problems: tuple[str, ...]
    trials: tuple[int, ...]
    """Executed trials that are readable."""
    options: dict[str, JsonValue]
    """Normalized (SI), before the sweep."""
    conditions: tuple[Said, ...]
    key_numbers: tuple[Finding, ...]
    """Requested results, the most important first: `findings`, or medians of draws."""
    notes: tuple[str, ...]
    findings: tuple[Finding, ...]
    comparisons: tuple[Comparison, ...]
    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]
    truth: Table | None
    """Its results beside the true values, if known."""
    prediction: Table | None
    """Its results beside the values of its bench file, if tested."""
    references: tuple[Table, ...]
    """Its results beside each file of reference values."""


class Line(_Part):
    """A published number beside the result, both in the printed unit."""

    table: str
    row: str
    column: str
    cell: str
    """Row and column in words."""
    unit: str
    published: float | None
    printed: str
    relation: str
    """`equal`, `near`, `at most`, `at least` or `rank`: claim of the document."""
    reproduced: float | None
    low: float | None
    high: float | None
    kind: str
    """Of the result; `at least` and `at most` are bounds. "" without a result."""
    deviation_percent: float | None
    verdict: str
    status: str
    test: str
    source: str
    notes: tuple[str, ...]
    draws: tuple[float | None, ...]
    """Result of each draw of a random bench."""
    place: Number | None
    """Share of the draws below the published number."""


class Count(_Part):
    """Counts of compared and of reproduced published numbers of one status."""

    status: str
    compared: int
    good: int
    numbers: int
    """Count of those with a deviation in percent."""
    within_percent: dict[str, int]
    """Count of these by largest deviation in percent."""


class Contradiction(_Part):
    """Cells of a published table that cannot all be correct."""

    table: str
    cells: tuple[str, ...]
    reason: str


class Scoreboard(_Part):
    """Published values beside the results; `further` are repeated results and do not count."""

    agreement: str
    """Summary in words."""
    counts: tuple[Count, ...]
    """Each published number counts once, also if printed several times."""
    closeness: Table | None
    """The counts as on the page."""
    not_reached: int
    not_found: int
    not_run: int
    lines: tuple[Line, ...]
    further: tuple[Line, ...]
    statuses: dict[str, int]
    """Number of lines by status."""
    sources: tuple[str, ...]
    altered: tuple[str, ...]
    contradictions: tuple[Contradiction, ...]
    figures: tuple[Figure, ...]
    file: str
    """The CSV file; "" without lines."""


class FailedTrial(_Part):
    """A trial that did not complete."""

    number: int
    label: str
    outcome: str
    reason: str
    safe_state: str


class Run(_Part):
    """The run of the report."""

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
    """Digests and versions of the run and of the report's program."""

    sha256: str
    """Of the archive file, as by `sha256sum`; for a run in progress, of its journal."""
    seal: str
    """Digest of the whole run; "" without a seal."""
    fingerprint: str
    """Of the normalized protocol."""
    command: str
    """Command that repeats the run."""
    seeds: str
    git_revision: str
    backend_options: dict[str, JsonValue]
    overrides: dict[str, str]
    only: tuple[str, ...]
    versions: dict[str, str]
    """At the time of execution."""
    plugins: tuple[dict[str, JsonValue], ...]
    host: dict[str, str]
    measured_by: str
    truths: tuple[str, ...]
    """Names of the benches simulated in place of the stated ones."""
    sources: dict[str, str]
    """Protocol and benches, verbatim."""
    truth_sources: dict[str, str]
    program: str
    """The version of campaign that made the report."""
    code: str
    """Hash of the sources of the analysis."""


class Incidents(_Part):
    """Deviations from the plan."""

    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]


class Section(_Part):
    """A section of a page other than a report."""

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
    """Data of this kind of page only."""


class ReportData(_Part):
    """A whole report."""

    format: int = FORMAT
    run: Run
    opening: FirstScreen
    """Top of the page; its numbers are in the tests' `key_numbers`."""
    scoreboard: Scoreboard
    tests: tuple[Test, ...]
    incidents: Incidents
    failed: tuple[FailedTrial, ...]
    problems: tuple[str, ...]
    damaged: tuple[str, ...]
    provenance: Provenance
