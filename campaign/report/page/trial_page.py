"""The page of a trial: channels, settings, metrics, outcome."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from campaign.archive.reading.damage_words import in_words
from campaign.channels import RELATIVE_ANGLE, RELATIVE_RATE
from campaign.estimation.relative_rate import relative_rate
from campaign.recording import Channel, Recording
from campaign.report.content import tables
from campaign.report.content.trial_account import TrialAccount, account_of, lost_account
from campaign.report.drawing.drawing_files import LEGIBLE
from campaign.report.drawing.traces import FONT, WIDTH, Stretch, Trace, draw_traces, key
from campaign.report.page.layout import Layout
from campaign.report.page.names import FOLDER, trial_file
from campaign.report.page.templates import Templates
from campaign.report.palette import looks, variables
from campaign.text import number, pretty_unit
from campaign.units import convert

Array = NDArray[np.float64]

FINEST = 0.02
"""Rate that must be told apart from encoder counts, as a share of the largest in the chart ..."""
LONGEST = 0.005
"""... and the longest filter for that, as a share of the time shown: a few pixels."""
FEWEST = 10
"""Samples of a rate that is filtered."""


@dataclass(frozen=True)
class Key:
    """What a line of a chart is: a piece of it, and the channel's label and name.

    `measured`: False for what only a simulator can know. `filtered`: how, in words; empty for what
    is drawn as it was recorded.
    """

    line: Markup
    label: str
    name: str
    measured: bool
    filtered: str = ""


@dataclass(frozen=True)
class Chart:
    """Channels of one unit over time: a picture, and what its lines are.

    `least`: CSS pixels that the picture must be wide for its labels to be legible.
    """

    unit: str
    svg: Markup
    keys: tuple[Key, ...]
    least: int = math.ceil(LEGIBLE / FONT * WIDTH)


def trial_pages(
    layout: Layout, numbers: Sequence[int], templates: Templates
) -> Iterator[tuple[str, str]]:
    """File within the report's folder and text of each trial's page, one after the other.

    Args:
        layout: the report's page, which they link back to.
        numbers: of executed trials, ascending.
        templates: `trial.html` is filled.
    """
    document = layout.document
    run, story = document.run, document.run.story
    there = {archived.trial.number: archived for archived in run.trials}
    tests = {test.name: test for test in document.tests}
    anchors = {section.test.name: section.anchor for section in layout.sections}
    for before, trial, behind in zip((0, *numbers), numbers, (*numbers[1:], 0), strict=False):
        archived = there.get(trial)
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
    """The link to another trial's page; empty for none."""
    return trial_file(number).removeprefix(f"{FOLDER}/") if number else ""


def charts(account: TrialAccount) -> tuple[Chart, ...]:
    """A chart for each unit, in the order in which the channels have them."""
    recording = account.recording
    if recording is None or not len(recording.time):
        return ()
    units: dict[str, list[Channel]] = {}
    for channel in recording.channels.values():
        units.setdefault(channel.display_unit or channel.unit, []).append(channel)
    windows = [Stretch(window.name, window.start, window.stop) for window in account.windows]
    moments = [(event.time, event.text) for event in recording.events]
    return tuple(
        _chart(recording, unit, channels, windows, moments) for unit, channels in units.items()
    )


def _chart(
    recording: Recording,
    unit: str,
    channels: Sequence[Channel],
    windows: Sequence[Stretch],
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
    """A channel's samples as they are drawn, and how they were filtered.

    A rate from encoder counts is a band of spikes that hides whatever is behind it: it is filtered
    until one sees the rate, by what the encoder tells alone.
    """
    samples, time = channel.samples, recording.time
    known = samples[np.isfinite(samples)]
    largest = float(np.abs(known).max(initial=0.0))
    if channel.name != RELATIVE_RATE or len(known) < FEWEST or not largest > 0:
        return samples, ""
    angle = recording[RELATIVE_ANGLE] if RELATIVE_ANGLE in recording.channels else None
    step, longest = float(np.median(np.diff(time))), LONGEST * float(np.ptp(time))
    held = np.zeros_like(samples)  # of the hull: without a gyro it is not asked for
    seen = relative_rate(samples, angle, None, held, step, FINEST * largest, longest)
    if not seen.window:
        return samples, ""
    how = "mean of"
    if angle is not None:
        linear = recording.channels[RELATIVE_ANGLE].unit == "m"
        how = f"slope of the {'position' if linear else 'angle'} over"
    why = "filtered, for its counts are coarse"
    return seen.values, f"{why}: {how} {number(1e3 * seen.window, 3)} ms"
