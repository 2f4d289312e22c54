"""Origin and processing of imported samples of a test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import ValidationError

from campaign.api.analysis import AnalysedTest
from campaign.importing.description import ChannelSource, RecordingDescription
from campaign.text import number

LISTED = 4
"""Maximum number of files, rates and remarks in a list."""
DIGEST = 12
"""Number of shown characters of a SHA-256; the archive has all of it."""


def recorded_from(test: AnalysedTest) -> Iterator[tuple[str, str]]:
    """Files, rates, channels with columns, and remarks of imported trials; empty without these."""
    descriptions = list(_described(test))
    if not descriptions:
        return
    files = {file.sha256: file.name for each in descriptions for file in each.files}
    named = [f"{name} (SHA-256 {digest[:DIGEST]}…)" for digest, name in files.items()]
    yield "Recorded in", _listed(named, "files")
    rates = dict.fromkeys(f"{number(each.sample_rate, 5)} Hz" for each in descriptions)
    yield "Sampled at", _listed(list(rates), "rates")
    channels = dict.fromkeys(_channel(made) for each in descriptions for made in each.channels)
    yield "Channels", "; ".join(channels)
    remarks = list(dict.fromkeys(remark for each in descriptions for remark in each.remarks))
    if remarks:
        yield "What was made of it", _listed(remarks, "remarks", "; ")


def _described(test: AnalysedTest) -> Iterator[RecordingDescription]:
    for archived in test.trials:
        if archived.trial.recording:
            try:
                yield RecordingDescription.model_validate(
                    archived.trial.recording, context={"si": True}
                )
            except ValidationError:  # from another version of this program
                continue


def _channel(made: ChannelSource) -> str:
    if made.how in ("derivative", "integral"):
        return f"{made.name}: {made.how} of {made.source}"
    if made.how == "copy":
        return f"{made.name}: from {made.source}"
    column = made.cells.name if made.cells is not None else ""
    return f"{made.name}: column '{column}'"


def _listed(items: Sequence[str], what: str, between: str = ", ") -> str:
    text = between.join(items[:LISTED])
    return text if len(items) <= LISTED else f"{text} … ({len(items)} {what})"
