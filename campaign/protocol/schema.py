"""The schema of a protocol file, and a loaded protocol.

The options of a test depend on its kind, so the experiment validates them. Here they are every key
of a test that is not a field of `TestEntry`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from campaign.options import Options, spelled
from campaign.physics.bench import Bench
from campaign.policy import Keep, Occasion, Policy, Response, Rest
from campaign.protocol.calibration import Calibration, CalibrationOptions
from campaign.protocol.files import Origin, PatchedTree
from campaign.protocol.matrix import Axis
from campaign.protocol.positions import Keys
from campaign.trial import Most, OfferedRecording, Tree, TrialRequest

Slug = Annotated[
    str,
    Field(max_length=60),
    spelled(
        r"[a-z0-9]+([-_][a-z0-9]+)*", "lower-case letters and digits, single - or _ between them"
    ),
]


@dataclass(frozen=True)
class ChosenValue:
    """A value (SI) that an experiment chose for an unwritten option of a test, and the reason."""

    value: Any
    reason: str


@dataclass(frozen=True)
class StageKind:
    """Data of a stage for a plan; see `campaign.experiments.interface.Stage`."""

    name: str
    why: str
    most: Callable[[Any, Bench], Most]


@dataclass(frozen=True)
class ExperimentKind:
    """Data of an experiment for a plan; see `campaign.experiments.interface.Experiment`."""

    name: str
    summary: str
    options: type[Options]
    trials: Callable[[Any, Bench], Iterable[TrialRequest]]
    _: KW_ONLY
    fit: Callable[[Any, Bench], Mapping[str, ChosenValue]] | None = None
    requires: Mapping[str, str] = field(default_factory=dict)
    can_use: Mapping[str, str] = field(default_factory=dict)
    seeks_instability: bool = False
    stages: tuple[StageKind, ...] = ()
    recorded: Callable[[Any, Bench, OfferedRecording], Iterable[TrialRequest]] | None = None
    windows: tuple[str, ...] = ()
    warnings: Callable[[Any, Bench], Iterable[str]] | None = None


class OperatorEntry(Options):
    """One `[[test.operator]]`: an action of the operator at the bench."""

    text: str = Field(min_length=1, max_length=500)
    """The action; {a.dotted.path} stands for the value there."""
    sets: tuple[str, ...] = ()
    """Swept paths that the operator sets, instead of the controller."""


class CheckEntry(Options):
    """`[check]`: one trial, repeated during the run."""

    test: str
    """The test whose first measurement is repeated."""
    every: int = Field(ge=1)
    """Number of the plan's measurements between checks."""


class TestEntry(Options):
    """One `[[test]]`, without the options of its kind."""

    __test__ = False  # not a test of pytest's
    model_config = ConfigDict(extra="ignore")

    name: Slug
    """Name of the test: lower-case letters, digits, - and _; unique over all includes."""
    kind: str
    """The experiment, one of `campaign kinds`."""
    bench: str
    """Path of a bench, relative to this file, or the bare name of a shipped one."""
    truth: str = ""
    """A bench that `sim` simulates in place of `bench`, hidden from plan and analysis."""
    title: str = ""
    """Heading of the test in the report."""
    description: str = ""
    """Purpose of the test, in a sentence or two."""
    group: str = ""
    """Heading of a group of tests in the report's contents; absent: that of the test before."""
    leading_figure: str = ""
    """Key of this test's figure at the top of the report; absent: it is selected."""
    reproduces: tuple[str, ...] = ()
    """Published tables, figures and claims to compare with: "5.2", "figure 5.4", "text 5.2.2.2"."""
    matrix: dict[str, Any] = {}
    """The sweep: dotted path to a list or a range."""
    repeat: int = Field(default=1, ge=1)
    """Number of executions of the whole matrix."""
    order: Literal["as written", "shuffled"] = "as written"
    """Order of the measurements within each repetition."""
    seed: int | None = Field(default=None, ge=0, lt=2**63)
    """Seed of everything random in the test; absent: it is drawn and recorded."""
    operator: tuple[OperatorEntry, ...] = ()
    """Actions of the operator, each under `[[test.operator]]`."""
    recording: tuple[dict[str, Any], ...] = ()
    """Existing recordings, in place of trials: `campaign import`."""


class ProtocolFile(Options):
    """The top level of a protocol file."""

    title: str = ""
    """Heading of the report."""
    description: str = ""
    """Purpose of the protocol."""
    operator: str = ""
    """Person responsible for the run."""
    notes: str = ""
    """Notes on the run."""
    tags: tuple[str, ...] = ()
    """Keywords of the run."""
    include: tuple[str, ...] = ()
    """Paths of protocols, relative to this file, whose tests come before this file's."""
    published: str = "thesis"
    """Published values to compare with: a path relative to this file, "none" or "thesis"."""
    calibration: CalibrationOptions | None = None
    """Settings of `campaign calibrate`; `campaign run` ignores them."""
    faults: dict[Occasion, Response] = {}
    """Responses to incomplete trials, by occasion."""
    rest: Rest | None = None
    """Pauses in which the bench cools down."""
    keep: Keep = "all"
    """Trials whose samples are archived: "all", "none", "failed", "extremes" or N of each test."""
    check: CheckEntry | None = None
    """A trial that is repeated to check that the bench has not changed."""
    columns: dict[str, dict[str, Any]] = {}
    """Columns of recordings, by a name of your own: `campaign import`."""
    test: tuple[dict[str, Any], ...] = ()
    """The tests, each under `[[test]]`."""


@dataclass(frozen=True)
class Test:
    """A validated test; its values are still as written, so that a sweep can replace them.

    Attributes:
        entry: the keys that every test has.
        options: the options of its kind as written, unswept.
        bench: the bench as written, unswept.
        bench_name: of its source.
        axes: the matrix, first key slowest.
        origin, bench_origin: places of options and bench, for later problems.
        truth: simulated in place of the bench, see `physics.truth.plant_of`; None: the bench.
        first: cache of `points.first_point`.
    """

    __test__ = False

    entry: TestEntry
    experiment: ExperimentKind
    options: Mapping[str, Any]
    bench: Mapping[str, Any]
    bench_name: str
    axes: tuple[Axis, ...]
    origin: Origin
    bench_origin: Origin
    truth: Tree | None = None
    first: list[Any] = field(init=False, default_factory=list, compare=False, repr=False)


@dataclass(frozen=True)
class Protocol:
    """A validated protocol with its includes.

    Attributes:
        path: of the file, as the user named it.
        published: "thesis", "none", or the name of a source.
        sources: verbatim text of every protocol, bench and published file, by its name as written.
        origin: of the file's top level, for later problems.
        overrides: texts of `--set`.
        calibration: None if the protocol has none.
        policy, check: of this file; those of included protocols do not apply.
        truth_sources: verbatim text of every truth, by its name as written; not among `sources`.
        columns: columns of imported files, as written in this file.
    """

    path: Path
    title: str
    description: str
    operator: str
    notes: str
    tags: tuple[str, ...]
    published: str
    tests: tuple[Test, ...]
    sources: Mapping[str, str]
    origin: Origin
    overrides: tuple[str, ...] = ()
    calibration: Calibration | None = None
    policy: Policy = field(default_factory=Policy)
    check: CheckEntry | None = None
    truth_sources: Mapping[str, str] = field(default_factory=dict)
    columns: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def with_values(tree: Mapping[str, Any], swept: Iterable[tuple[Axis, int]]) -> dict[str, Any]:
    """A copy of options or bench with values of its swept paths, each by its index in the axis."""
    copy = dict(tree)
    for axis, index in swept:
        copy = replaced(copy, axis.keys, axis.value(index))
    return copy


def origin_with_values(origin: Origin, swept: Iterable[tuple[Axis, int]]) -> PatchedTree:
    """The origin of that copy."""
    return PatchedTree(origin, [(axis.keys, axis.value_origin(index)) for axis, index in swept])


def split_entry(tree: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The keys of a `[[test]]` that every test has, and the options of its kind."""
    common = {key: value for key, value in tree.items() if key in TestEntry.model_fields}
    options = {key: value for key, value in tree.items() if key not in common}
    return common, options


def replaced(tree: Mapping[str, Any], keys: Keys, value: Any) -> dict[str, Any]:
    """A copy of nested tables with `value` at `keys`; absent tables on the path are created."""
    copy = dict(tree)
    key = str(keys[0])
    if len(keys) == 1:
        copy[key] = value
    else:
        below = copy.get(key)
        copy[key] = replaced(below if isinstance(below, Mapping) else {}, keys[1:], value)
    return copy
