"""The header of a sealed run: one dataset per field."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import h5py
from pydantic import ValidationError

from campaign.archive import guarded
from campaign.archive.damage import DamageList
from campaign.archive.header import RunHeader
from campaign.archive.run_folder import check_format, first_line
from campaign.errors import ArchiveError

PROVENANCE = "/run/provenance"


def read_provenance(run: h5py.Group, damaged: DamageList) -> RunHeader:
    """What was known before the first trial; a field that cannot be read is noted and left out.

    Raises ArchiveError when the format, the name or the start cannot be read: without them it is
    no run.
    """
    provenance = guarded.group_at(run, "provenance", "NXcollection")
    check_format(damaged.path, guarded.integer_at(provenance, "format"))
    tree: dict[str, Any] = {"sources": dict(_sources(run, damaged))}
    for name, info in RunHeader.model_fields.items():
        if info.is_required():
            tree[name] = guarded.text_at(provenance, name)
        elif name != "sources" and name in provenance:
            with damaged.noting(), guarded.guarded(damaged.path, f"{PROVENANCE}/{name}"):
                text = guarded.text_at(provenance, name)
                tree[name] = text if info.annotation is str else _json(damaged, name, text)
    return _validated(tree, damaged)


def _validated(tree: dict[str, Any], damaged: DamageList) -> RunHeader:
    try:
        return RunHeader.model_validate(tree)
    except ValidationError as error:
        problems = {str(p["loc"][0]): p["msg"] for p in error.errors(include_url=False)}
    required = {name for name, info in RunHeader.model_fields.items() if info.is_required()}
    for name, what in problems.items():
        if name in required:
            raise ArchiveError(f"{damaged.path}: {PROVENANCE}/{name}: {what}")
        damaged.add(f"{PROVENANCE}/{name}", what)
    return RunHeader.model_validate({k: v for k, v in tree.items() if k not in problems})


def _sources(run: h5py.Group, damaged: DamageList) -> Iterator[tuple[str, str]]:
    for name in guarded.names(run):
        if name.startswith("source_"):
            with damaged.noting(), guarded.guarded(damaged.path, f"/run/{name}"):
                note = guarded.group_at(run, name, "NXnote")
                yield guarded.text_at(note, "file_name"), guarded.text_at(note, "data")


def _json(damaged: DamageList, name: str, text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArchiveError(f"{damaged.path}: {PROVENANCE}/{name}: {first_line(error)}") from None
