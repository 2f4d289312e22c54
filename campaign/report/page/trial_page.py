"""Page of a trial: channels, settings, metrics, outcome."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from campaign.archive.reading.damage_words import in_words
from campaign.channels import RELATIVE_ANGLE, RELATIVE_RATE
from campaign.estimate import Window
from campaign.estimation.relative_rate import relative_rate
from campaign.recording import Channel, Recording
from campaign.report.content import tables
from campaign.report.content.trial_account import TrialAccount, account_of, lost_account
from campaign.report.drawing.drawing_files import LEGIBLE
from campaign.report.drawing.traces import FONT, WIDTH, Trace, draw_traces, key
from campaign.report.page.layout import Layout
from campaign.report.page.names import FOLDER, trial_file
from campaign.report.page.templates import Templates
from campaign.report.palette import looks, variables
from campaign.text import number, pretty_unit
from campaign.units import convert

Array = NDArray[np.float64]

FINEST = 0.02
"""Required resolution of a filtered encoder rate, as a share of the largest rate ..."""
LONGEST = 0.005
"""... and the longest filter for it, as a share of the shown time: a few pixels."""
FEWEST = 10
"""Minimum number of samples of a filtered rate."""


@dataclass(frozen=True)
class Key:
    """Legend entry of a chart: a piece of the line, and the channel's label and name.

    `measured`: False for a channel that only a simulator has. `filtered`: description of the
    filter; empty for a channel that is drawn as recorded.
    """

    line: Markup
    label: str
    name: str
    measured: bool
    filtered: str = ""


@dataclass(frozen=True)
class Chart:
    """Channels of one unit over time: a picture and its legend.

    `least`: minimum width of the picture for legible labels (CSS pixels).
    """

    unit: str
    svg: Markup
    keys: tuple[Key, ...]
    least: int = math.ceil(LEGIBLE / FONT * WIDTH)


def trial_pages(
    layout: Layout, numbers: Sequence[int], templates: Templates
) -> Iterator[tuple[str, str]]:
    """Path within the report's folder and text of each trial's page.

    Args:
        layout: the report's page, to which they link.
        numbers: numbers of executed trials, ascending.
        templates: contains `trial.html`.
    """
    document = layout.document
    run, story = document.run, document.run.story
    archived_trials = {archived.trial.number: archived for archived in run.trials}
    tests = {test.name: test for test in document.tests}
    anchors = {section.test.name: section.anchor for section in layout.sections}
    for before, trial, behind in zip((0, *numbers), numbers, (*numbers[1:], 0), strict=False):
        archived = archived_trials.get(trial)
        if archived is None:
            account, anchor = lost_account(run, trial), ""
        else:
            test = tests.get(archived.trial.test)
            account = account_of(run, archived, story, test)
            anchor = anchors.get(archived.trial.test, "")
        context = {
            "trial": account,
            "charts": charts(account),
            "tables": [(table, tables.show(table, once=False)) for table in account.tables],
            "damage": [in_words(damage) for damage in account.damaged],
            "run": run,
            "header": run.header,
            "title": document.title,
            "anchor": anchor,
            "before": _beside(before),
            "behind": _beside(behind),
            "colours": variables(),
        }
        yield trial_file(trial), templates.fill("trial.html", context)


def _beside(number: int) -> str:
    """Link to another trial's page; empty for 0."""
    return trial_file(number).removeprefix(f"{FOLDER}/") if number else ""


def charts(account: TrialAccount) -> tuple[Chart, ...]:
    """One chart per unit, in the order of the channels."""
    recording = account.recording
    if recording is None or not len(recording.time):
        return ()
    units: dict[str, list[Channel]] = {}
    for channel in recording.channels.values():
        units.setdefault(channel.display_unit or channel.unit, []).append(channel)
    moments = [(event.time, event.text) for event in recording.events]
    return tuple(
        _chart(recording, unit, channels, account.windows, moments)
        for unit, channels in units.items()
    )


def _chart(
    recording: Recording,
    unit: str,
    channels: Sequence[Channel],
    windows: Sequence[Window],
    moments: Sequence[tuple[float, str]],
) -> Chart:
    look = looks(channel.name for channel in channels)
    traces, keys = [], []
    for each in channels:
        samples, filtered = legible(recording, each)
        traces.append(Trace(each.label, convert(samples, each.unit, unit), look[each.name]))
        keys.append(Key(key(look[each.name]), each.label, each.name, each.measured, filtered))
    axis = pretty_unit(unit) or "no unit"
    return Chart(axis, draw_traces(recording.time, traces, axis, windows, moments), tuple(keys))


def legible(recording: Recording, channel: Channel) -> tuple[Array, str]:
    """Drawn samples of a channel, and a description of their filter ("" for none).

    A rate from encoder counts is a band of spikes that hides other lines. It is filtered until the
    rate is visible, using the encoder only.
    """
    samples, time = channel.samples, recording.time
    known = samples[np.isfinite(samples)]
    largest = float(np.abs(known).max(initial=0.0))
    if channel.name != RELATIVE_RATE or len(known) < FEWEST or not largest > 0:
        return samples, ""
    angle = recording[RELATIVE_ANGLE] if RELATIVE_ANGLE in recording.channels else None
    step, longest = float(np.median(np.diff(time))), LONGEST * float(np.ptp(time))
    held = np.zeros_like(samples)  # motion of the base, which is not used without a gyro
    seen = relative_rate(samples, angle, None, held, step, FINEST * largest, longest)
    if not seen.window:
        return samples, ""
    how = "mean of"
    if angle is not None:
        linear = recording.channels[RELATIVE_ANGLE].unit == "m"
        how = f"slope of the {'position' if linear else 'angle'} over"
    why = "filtered, for its counts are coarse"
    return seen.values, f"{why}: {how} {number(1e3 * seen.window, 3)} ms"
