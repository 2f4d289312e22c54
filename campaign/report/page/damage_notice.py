"""Notice that a report is incomplete, on the page and in every file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import FILE, damaged_csv, heading, in_one_line
from campaign.archive.reading.run_reader import RunReader
from campaign.report.page.folder import Download, Folder

TRIALS = 12
"""Maximum number of trials in the notice."""


@dataclass(frozen=True)
class Notice:
    """Notice at the top of the page.

    Attributes:
        heading: the run's file, and the number of damaged places.
        trials: names of the damaged trials, as text; empty without any.
        download: table of all damage.
    """

    heading: str
    trials: str
    download: Download


def notice_on_page(run: RunReader, damaged: Sequence[Damage], folder: Folder) -> Notice:
    """Make the notice; add `tables/damaged.csv` to the folder, and a description to SVG files."""
    name = Path(run.path.name)
    words = in_one_line(name, damaged)
    for file, text in folder.files.items():
        if file.endswith(".svg"):
            folder.files[file] = _with_word(text, words)
    download = folder.table(damaged_csv(damaged), Path(FILE).stem)
    return Notice(heading(name, damaged), _trials(damaged), download)


def _trials(damaged: Sequence[Damage]) -> str:
    names = list(dict.fromkeys(damage.trial for damage in damaged if damage.trial))
    more = [f"{len(names) - TRIALS} more"] if len(names) > TRIALS else []
    return ", ".join([*names[:TRIALS], *more])


def _with_word(svg: str, words: str) -> str:
    """Add a description to a figure's file; on the page, the notice has this text."""
    from markupsafe import escape

    place = svg.index(">", svg.index("<svg")) + 1
    return f"{svg[:place]}\n <desc>{escape(words)}</desc>{svg[place:]}"
