"""Parquet: one column per channel, with unit and label in its metadata."""

from __future__ import annotations

from pathlib import Path

from campaign.api import TrialView
from campaign.archive.reading.damage_words import in_words
from campaign.errors import UsageError
from campaign.export.interface import ExportKind
from campaign.recording import Recording
from campaign.trial import canonical_json


def _write(trial: TrialView, recording: Recording, path: Path) -> None:
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise UsageError(
            "exporting to Parquet needs pyarrow: pip install 'campaign[parquet]'"
        ) from None
    channels = list(recording.channels.values())
    fields = [
        pa.field(name, pa.float64(), nullable=False, metadata={"units": unit, "label": label})
        for name, unit, label in [
            ("time", "s", "Time"),
            *((c.name, c.unit, c.label) for c in channels),
        ]
    ]
    about = {
        "title": trial.trial.label,
        "outcome": trial.ending.outcome.value,
        "reason": trial.ending.reason,
        "damaged": canonical_json(list(map(in_words, trial.damaged))),
        "trial": canonical_json(trial.trial.model_dump(mode="json")),
    }
    table = pa.table(
        [recording.time, *(channel.samples for channel in channels)],
        schema=pa.schema(fields, metadata=about),
    )
    parquet.write_table(table, path)


EXPORT = ExportKind("parquet", "for data tools, units in the columns' metadata", ".parquet", _write)
