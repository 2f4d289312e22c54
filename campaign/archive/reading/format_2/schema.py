"""What an archive consists of, as a table: `docs/archive-format.md` for programs."""

from __future__ import annotations

import re
from dataclasses import dataclass

from campaign.archive.layout.header import RunHeader

HASH_PLACE = "/run/outcome/file_sha256"
"""The file's own hash, the only dataset without a checksum."""

ENTRY = re.compile(r"trial_([0-9]{5,10})(?:_attempt_([0-9]{1,6}))?")


@dataclass(frozen=True)
class Shape:
    """What a group is and holds.

    Attributes:
        nx_class: NeXus class.
        required: names of what must be there.
        optional: what else may be, as a pattern of whole names.
        attributes: names of attributes that must be there.
    """

    nx_class: str
    required: frozenset[str] = frozenset()
    optional: str = ""
    attributes: frozenset[str] = frozenset()

    def knows(self, name: str) -> bool:
        return name in self.required or re.fullmatch(self.optional, name) is not None


def shape_of(place: str, version: int) -> Shape | None:
    """What the format says of the group at `place`, e.g. `/run/plan`; None when it does not."""
    parts = place.strip("/").split("/")
    if place == "/":
        return _ROOT
    if parts[0] == "run":
        return _of_run(parts[1:], version)
    if ENTRY.fullmatch(parts[0]):
        return _of_trial(parts[1:], version)
    return None


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


def _of_run(parts: list[str], version: int) -> Shape | None:
    if not parts:
        return _RUN if version == 1 else _RUN_2
    if len(parts) == 1 and re.fullmatch(
        r"plan|plan_trials|plan_trees|journal|source_\d+", parts[0]
    ):
        return _NOTE
    return {"provenance": _PROVENANCE, "outcome": _OUTCOME}.get("/".join(parts))


def _of_trial(parts: list[str], version: int) -> Shape | None:
    if not parts:
        return _TRIAL
    if parts[0] == "instrument" and len(parts) <= _DEEPEST:
        return _INSTRUMENT
    record = _RECORD if version == 1 else _RECORD_2
    return {"record": record, "data": _DATA, "preview": _DATA}.get("/".join(parts))


_DEEPEST = 4
_NOTES = re.compile(r"plan|plan_trials|plan_trees|journal|source_\d+")
_ANY_NAME = r"[A-Za-z_]\w{0,62}"
_ROOT = Shape("NXroot", _names("run"), ENTRY.pattern, _names("creator creator_version file_time"))
_ABOUT_RUN = _names(
    "title entry_identifier start_time end_time program_name plan journal provenance outcome"
)
_RUN = Shape("NXentry", _ABOUT_RUN, r"source_\d+")
_RUN_2 = Shape("NXentry", _ABOUT_RUN | _names("plan_trials plan_trees"), r"source_\d+")
_NOTE = Shape("NXnote", _names("type file_name data"))
_PROVENANCE = Shape(
    "NXcollection",
    _names("format name created"),
    "|".join(sorted(set(RunHeader.model_fields) - {"sources"})),
)
_OUTCOME = Shape(
    "NXcollection",
    _names("status reason safe_state trials_finished trials_failed file_sha256"),
)
_TRIAL = Shape(
    "NXentry",
    _names("title entry_identifier start_time end_time record"),
    "data|preview|definition|instrument",
)
_KEPT = _names("trial fingerprint outcome reason safe_state channels events")
_RECORD = Shape("NXcollection", _KEPT)
_RECORD_2 = Shape("NXcollection", _KEPT, "fault|telemetry")
_DATA = Shape("NXdata", _names("time title"), _ANY_NAME, _names("signal axes time_indices"))
_INSTRUMENT = Shape("", frozenset(), _ANY_NAME)
