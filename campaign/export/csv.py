"""CSV: one line per sample, units in the heading, every digit of a float."""

from __future__ import annotations

from pathlib import Path

from campaign.api import TrialView
from campaign.export.interface import ExportKind
from campaign.plain_text import on_a_page
from campaign.recording import Recording


def _write(trial: TrialView, recording: Recording, path: Path) -> None:
    import pandas as pd

    columns = {"time (s)": recording.time}
    for channel in recording.channels.values():
        columns[_heading(channel.name, channel.unit)] = channel.samples
    # Without a format, floats are written with all digits that a lossless read needs.
    pd.DataFrame(columns).to_csv(
        path, index=False, na_rep="nan", lineterminator="\n", encoding="utf-8"
    )


def _heading(name: str, unit: str) -> str:
    return on_a_page(f"{name} ({unit})" if unit else name)


EXPORT = ExportKind("csv", "text, one line per sample, units in the heading", ".csv", _write)
