"""Origin and processing of imported samples of a test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import ValidationError

from campaign.api.analysis import AnalysedTest
from campaign.importing.description import ChannelSource, RecordingDescription
from campaign.text import number

LISTED = 4
"""Most files, rates and remarks that are told one by one."""
DIGEST = 12
"""Characters of a SHA-256 by which a file is told from others; the archive has all of it."""


def recorded_from(test: AnalysedTest) -> Iterator[tuple[str, str]]:
    """Files, rates, channels with their columns, and remarks; nothing of what was executed here."""
    told = list(_described(test))
    if not told:
        return
    files = {file.sha256: file.name for each in told for file in each.files}
    named = [f"{name} (SHA-256 {digest[:DIGEST]}…)" for digest, name in files.items()]
    yield "Recorded in", _listed(named, "files")
    rates = dict.fromkeys(f"{number(each.sample_rate, 5)} Hz" for each in told)
    yield "Sampled at", _listed(list(rates), "rates")
    channels = dict.fromkeys(_channel(made) for each in told for made in each.channels)
    yield "Channels", "; ".join(channels)
    remarks = list(dict.fromkeys(remark for each in told for remark in each.remarks))
    if remarks:
        yield "What was made of it", _listed(remarks, "remarks", "; ")


def _described(test: AnalysedTest) -> Iterator[RecordingDescription]:
    for archived in test.trials:
        if archived.trial.recording:
            try:
                yield RecordingDescription.model_validate(
                    archived.trial.recording, context={"si": True}
                )
            except ValidationError:  # of another version of this program
                continue


def _channel(made: ChannelSource) -> str:
    if made.how in ("derivative", "integral"):
        return f"{made.name}: {made.how} of {made.source}"
    if made.how == "copy":
        return f"{made.name}: from {made.source}"
    column = made.cells.name if made.cells is not None else ""
    return f"{made.name}: column '{column}'"


def _listed(items: Sequence[str], what: str, between: str = ", ") -> str:
    told = between.join(items[:LISTED])
    return told if len(items) <= LISTED else f"{told} … ({len(items)} {what})"
