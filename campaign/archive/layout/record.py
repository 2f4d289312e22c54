"""The record of a trial: everything but its samples, as one text.

The record names every recorded series, with its unit and the digest of its samples. So the digest
of the record covers the whole trial, wherever its samples are stored and even if they were not
kept. Many trials share benches and options, so a record refers to them by SHA-256; `trees` contains
each once.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from pydantic import Field, JsonValue

from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.header import ArchivedModel
from campaign.archive.layout.journal import TrialFinished
from campaign.archive.layout.names import file_name
from campaign.estimate import Estimate, Window
from campaign.recording import ChannelInfo, Ending, Fault, Outcome, SafeState
from campaign.trial import Tree, Trial, canonical_json, fingerprint, tree_text

SHARED = ("bench", "options")
"""Fields of a trial that are stored in `trees`."""

Trees = Mapping[str, Tree]
"""Benches and options by the SHA-256 of their canonical JSON."""

_TREE = re.compile(r'\{"sha256":"([0-9a-f]{64})","tree":(\{.*\})\}')
_DETERMINING = ("task", "seed")
_DETERMINING_WHERE_THERE = ("truth", "recording")
"""Fields of a trial that form its fingerprint with its bench; the latter if they are not empty."""


class SeriesRecord(ArchivedModel):
    """A recorded channel: its description, and the digest of its samples."""

    name: str
    unit: str
    label: str
    display_unit: str
    measured: bool = True
    own_rate: float | None = None
    sha256: str

    @classmethod
    def of(cls, channel: ChannelInfo, sha256: str) -> Self:
        return cls(**vars(channel), sha256=sha256)

    @property
    def info(self) -> ChannelInfo:
        return ChannelInfo(
            self.name, self.unit, self.label, self.display_unit, self.measured, self.own_rate
        )


class PreviewRecord(ArchivedModel):
    """The digests of a long recording's preview: its times, and one channel."""

    channel: str
    samples: int = Field(ge=0)
    time: str
    values: str


class EventRecord(ArchivedModel):
    """An event, at the time of the trial (s)."""

    time: float
    text: str


class TrialRecord(ArchivedModel):
    """An executed trial.

    Attributes:
        trial: the resolved trial, with the digest of a tree in place of each of `SHARED`.
        label: of the trial, for readers.
        fingerprint: `Trial.fingerprint` at the time of execution.
        attempt: number of this execution of the trial, from 1.
        started, ended: ISO 8601.
        samples: length of each series; None if no channel was announced.
        time: digest of the time base.
        windows: parts that an analysis uses, if they differ from the one in `trial`.
        estimates: numbers computed during the trial, each with its interval.
        measured_by: code that computed them, with its version.
    """

    trial: Tree
    label: str
    fingerprint: str
    attempt: int = Field(ge=1)
    started: str
    ended: str
    outcome: Outcome
    reason: str
    safe_state: SafeState
    fault: Fault | None = None
    telemetry: Tree = {}
    samples: int | None = Field(default=None, ge=0)
    time: str = ""
    channels: tuple[SeriesRecord, ...] = ()
    preview: PreviewRecord | None = None
    events: tuple[EventRecord, ...] = ()
    windows: tuple[Window, ...] = ()
    estimates: tuple[Estimate, ...] = ()
    measured_by: str = ""

    @property
    def number(self) -> int:
        return int(self.trial["number"])  # type: ignore[arg-type]

    @property
    def tree_names(self) -> frozenset[str]:
        """The digests of its trees."""
        return frozenset(str(self.trial[name]) for name in SHARED)

    @property
    def ending(self) -> Ending:
        return Ending(self.outcome, self.reason, self.safe_state, self.fault, self.telemetry)

    @property
    def series(self) -> tuple[ChannelInfo, ...]:
        """The announced channels."""
        return tuple(channel.info for channel in self.channels)

    def fingerprint_of(self, trees: Trees) -> str:
        """The fingerprint of the trial as stored.

        `Trial.fingerprint` would change when a later program adds a field with a default, which
        old archives do not have.
        """
        there = (name for name in _DETERMINING_WHERE_THERE if self.trial.get(name))
        others = {name: self.trial[name] for name in (*_DETERMINING, *there)}
        return fingerprint(trees[str(self.trial["bench"])], others)

    @cached_property
    def text(self) -> str:
        """The archived text: canonical JSON, without fields that have their default."""
        tree = self.model_dump(mode="json", exclude_defaults=True)
        return canonical_json(tree)

    @property
    def sha256(self) -> str:
        return text_digest(self.text)


def restored_trial(described: Tree, trees: Trees) -> Trial:
    """Inverse of `shared_trees`. Raises LookupError if a tree is missing, ValueError."""
    own: dict[str, JsonValue] = {**described, **{name: {} for name in SHARED}}
    shared = {name: trees[str(described[name])] for name in SHARED}
    # The trees were checked against their digests; validating them again takes the most time.
    return Trial.model_validate(own).model_copy(update=shared)


def shared_trees(trial: Trial) -> tuple[Tree, dict[str, Tree]]:
    """A trial with digests in place of its trees, and the trees by digest."""
    described = trial.model_dump(mode="json", exclude=set(SHARED))
    trees = {}
    for name in SHARED:
        tree = getattr(trial, name)
        described[name] = text_digest(tree_text(tree))
        trees[described[name]] = tree
    return described, trees


def trees_text(trees: Trees) -> str:
    """Trees as JSON lines, in the order of their digests."""
    return "".join(
        f'{{"sha256":"{digest}","tree":{tree_text(tree)}}}\n'
        for digest, tree in sorted(trees.items())
    )


def parse_trees(text: str) -> dict[str, Tree]:
    """Trees from JSON lines, checked against their digests. Raises ValueError for a bad line."""
    trees = {}
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            digest, tree = _tree(line)
        except ValueError as error:
            raise ValueError(f"line {number} {error}") from None
        trees[digest] = tree
    return trees


@lru_cache(maxsize=16)
def _tree(line: str) -> tuple[str, Tree]:
    """Digest and tree of a line. Successive trials share the tree, so it must not be changed."""
    match = _TREE.fullmatch(line)
    # The text of a tree is hashed unparsed: written trees are canonical.
    if match is None or text_digest(match[2]) != match[1]:
        raise ValueError("does not match its digest")
    try:
        return match[1], json.loads(match[2])
    except RecursionError:
        raise ValueError("is nested too deeply") from None


def series_of(record: TrialRecord) -> Iterator[tuple[str, str, int, str]]:
    """Group, name, length and digest of every series of an entry."""
    if record.samples is not None:
        yield "data", "time", record.samples, record.time
        for channel in record.channels:
            yield "data", channel.name, record.samples, channel.sha256
    if (preview := record.preview) is not None:
        yield "preview", "time", preview.samples, preview.time
        yield "preview", preview.channel, preview.samples, preview.values


def plain(value: Any) -> Any:
    """`value` as JSON types; converts anything, because telemetry must not lose a trial."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return str(value)


def trial_finished(record: TrialRecord, sha256: str, size: int) -> TrialFinished:
    """The line of the journal for a trial, whose file has this hash and size (bytes)."""
    return TrialFinished(
        at=record.ended,
        trial=record.number,
        attempt=record.attempt,
        file=file_name(record.number, record.attempt),
        sha256=sha256,
        record=record.sha256,
        bytes=size,
        outcome=record.outcome,
        reason=record.reason,
        safe_state=record.safe_state,
    )
