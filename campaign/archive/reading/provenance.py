"""The header of a sealed run: one dataset per field."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.seal import SealedTexts
from campaign.errors import ArchiveError

PROVENANCE = "/run/provenance"


def read_provenance(texts: SealedTexts, damaged: DamageList) -> RunHeader:
    """Read the header of a run; an unreadable field is noted in `damaged` and left out.

    Raises ArchiveError if a required field (name, start) is unreadable.
    """
    names = texts.names("provenance")
    tree: dict[str, Any] = {"sources": dict(_sources(texts, damaged))}
    for name, info in RunHeader.model_fields.items():
        if info.is_required():
            tree[name] = texts.text(f"provenance/{name}")
        elif name != "sources" and name in names:
            with damaged.noting():
                content = texts.text(f"provenance/{name}")
                tree[name] = content if info.annotation is str else _json(damaged, name, content)
    return _validated(tree, damaged)


def _sources(texts: SealedTexts, damaged: DamageList) -> Iterator[tuple[str, str]]:
    for name in texts.notes("source_"):
        with damaged.noting():
            yield texts.text(f"{name}/file_name"), texts.text(f"{name}/data")


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


def _json(damaged: DamageList, name: str, text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArchiveError(f"{damaged.path}: {PROVENANCE}/{name}: {first_line(error)}") from None
