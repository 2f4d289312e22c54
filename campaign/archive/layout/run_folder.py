"""The text files in the folder of a run in progress."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from campaign.archive.layout.files import read_errors, why
from campaign.archive.layout.header import FORMAT, PlannedTrial, RunHeader
from campaign.archive.layout.json_lines import parse_at_once
from campaign.archive.layout.names import HEADER
from campaign.errors import ArchiveError
from campaign.trial import canonical_json

_PLANNED = TypeAdapter(list[PlannedTrial])


def read_header(folder: Path) -> RunHeader:
    """The header of a run in progress. Raises ArchiveError if it is missing or invalid."""
    path = folder / HEADER
    try:
        document = json.loads(read_text(path))
        check_format(path, int(document["format"]))
        return RunHeader.model_validate(document["header"])
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise ArchiveError(f"{path}: is not the header of a run: {first_line(error)}") from None


def header_document(header: RunHeader) -> str:
    """The content of `run.json`."""
    return canonical_json({"format": FORMAT, "header": header.model_dump(mode="json")}) + "\n"


def parse_plan(path: Path, text: str) -> tuple[PlannedTrial, ...]:
    """The planned trials, in order. Raises ArchiveError with the number of an invalid line."""
    if (planned := parse_at_once(_PLANNED, text.encode().splitlines())) is not None:
        return tuple(planned)
    trials = []
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            trials.append(PlannedTrial.model_validate_json(line))
        except ValidationError as error:
            raise ArchiveError(f"{path}: plan, line {number}: {first_line(error)}") from None
    return tuple(trials)


def check_format(path: Path, version: int) -> None:
    """Raise ArchiveError if the archive format is not that of this program."""
    if version != FORMAT:
        raise ArchiveError(
            f"{path}: has format {version}, and this program reads format {FORMAT} alone; read it "
            "with the program that wrote it"
        )


def first_line(error: Exception) -> str:
    """Reason of an error in one line; for pydantic the first field and its problem."""
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False)[0]
        return f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}"
    return why(error)


def read_text(path: Path) -> str:
    """Read one of the files. Raises ArchiveError if it is unreadable or not UTF-8."""
    try:
        with read_errors(path):
            return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ArchiveError(f"{path}: is not text") from None
