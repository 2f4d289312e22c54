"""The mapping of returned columns to channels: read, or drafted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from campaign.axis_kind import Sides, sides_in
from campaign.channels import COMMAND, VOCABULARY, KnownBy, unit_of
from campaign.errors import Problem, ProtocolError
from campaign.importing.mapping import Layout, layouts
from campaign.protocol.files import Source, UnreadableError, read_source
from campaign.protocol.problems import allowed, shown
from campaign.text import nearest
from campaign.trial import Trial

NAME = "rig"
"""Name of the layout in a first mapping."""
_HEAD = """\
# Which columns of the files that come back are which channels. As it stands, it reads files with
# the headings `time`, `command` ... in the units given here: change `column` and `unit` to those
# of your files. `campaign kinds channels` says what each channel is, docs/handover.md what else may
# be said of a column: sign = -1, times = "35.15 N/V", offset = 2.5, delay = "2 ms" ...
"""


def read_layouts(path: Path) -> dict[str, Layout]:
    """All `[columns.NAME]` of a file. Raises ProtocolError with all problems."""
    try:
        source = read_source(path, path.name)
    except UnreadableError as error:
        raise ProtocolError([Problem(path, 0, 0, str(error))]) from None
    if not isinstance(source, Source):
        raise ProtocolError(source)
    columns = source.tree.get("columns")
    if not isinstance(columns, dict) or not all(isinstance(t, dict) for t in columns.values()):
        message = "nothing says what the columns are; add [columns.NAME.CHANNEL] tables"
        raise ProtocolError([Problem(path, 0, 0, message)])
    problems: list[Problem] = []
    known = layouts(columns, source, problems)
    if problems:
        raise ProtocolError(problems)
    return known


def layout_of(trial: Trial, known: Mapping[str, Layout], name: str, path: Path) -> Layout:
    """Layout of a trial: `name`, else the only one, else that with the name of its test or mode.

    Modes have different layouts, since a command is a rate in one and a torque in another.
    Raises ProtocolError.
    """
    if not name and len(known) == 1:
        return next(iter(known.values()))
    for wanted in (name,) if name else (trial.test, trial.task.mode):
        if wanted in known:
            return known[wanted]
    if name:
        message = (
            f"there is no [columns.{name}]; {allowed(list(known))}{nearest(name, list(known))}"
        )
    else:
        message = (
            f"none of its layouts is called {shown(trial.test)} as the test or "
            f"{shown(trial.task.mode)} as its mode; {allowed(list(known))}; "
            "--set backend.columns=NAME says which one reads all"
        )
    raise ProtocolError([Problem(path, 0, 0, message)])


def requested_channels(trials: Sequence[Trial]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The channels that some of `trials` require, with the command; and optional channels."""
    required = dict.fromkeys((COMMAND, *(name for trial in trials for name in trial.requires)))
    useful = dict.fromkeys(name for trial in trials for name in trial.can_use)
    return tuple(required), tuple(
        name for name in useful if name not in required and can_be_recorded(name)
    )


def first_mapping(trials: Sequence[Trial]) -> str:
    """Draft of a mapping with the requested channels, to be adapted to the rig."""
    modes = tuple(dict.fromkeys(trial.task.mode for trial in trials))
    text = _HEAD
    for mode in modes:
        of_mode = [trial for trial in trials if trial.task.mode == mode]
        text += _layout(NAME if len(modes) == 1 else mode, mode, of_mode)
    return text


def _layout(name: str, mode: str, trials: Sequence[Trial]) -> str:
    required, useful = requested_channels(trials)
    sides = sides_in(trials[0].bench)
    text = f'\n[columns.{name}.time]\ncolumn = "time"\nunit = "s"\n'
    for channel in required:
        text += "\n" + "\n".join(_entry(name, channel, mode, sides)) + "\n"
    if useful:
        text += "\n# Of use to some analyses, where the rig records it:\n"
    for channel in useful:
        text += "\n" + "\n".join(f"# {line}" for line in _entry(name, channel, mode, sides)) + "\n"
    return text


def _entry(layout: str, name: str, mode: str, sides: Sides) -> list[str]:
    unit = unit_of(name, mode, sides) or "1"
    return [f"[columns.{layout}.{name}]", f'column = "{name}"', f'unit = "{unit}"']


def can_be_recorded(name: str) -> bool:
    """Whether a rig can have a sensor for this channel."""
    return name not in VOCABULARY or VOCABULARY[name].known_by is not KnownBy.SIMULATOR
