"""Pictures of a page that are not from an analysis: scoreboard, draws, changes."""

from __future__ import annotations

from collections.abc import Sequence

from campaign.published.scoreboard import Scoreboard
from campaign.references.verdict import JudgedNumber, Verdict
from campaign.report.content.lines import agreement
from campaign.report.drawing.changes_picture import draw_changes, with_change
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.strips import draw_strips
from campaign.report.page.folder import Folder, ShownFigure


def changes_figure(
    pairs: Sequence[tuple[JudgedNumber, str]], folder: Folder, key: str
) -> ShownFigure | None:
    """Picture of changes against references, declared ones first; None without any change."""
    pairs = sorted(pairs, key=lambda each: each[0].verdict is not Verdict.DIFFERENT)
    shown = with_change(pairs)
    if not shown:
        return None
    declared = [name for pair, name in pairs if pair.verdict is Verdict.DIFFERENT]
    return folder.picture(
        DrawingFiles.of(draw_changes(shown)),
        "Changes in percent",
        "Each sign is a number with a reference, the bar the 95 % interval of its change. Filled: "
        "declared different. Hollow: no difference is shown, or it is not judged (diamonds).",
        f"Declared different: {'; '.join(declared)}." if declared else "No difference is declared.",
        key,
    )


def overview(
    scoreboard: Scoreboard, folder: Folder, drawn: DrawingFiles | None
) -> ShownFigure | None:
    """Picture of the scoreboard; None without a drawing."""
    if drawn is None:
        return None
    return folder.picture(
        drawn,
        "Deviation from the published values",
        "One sign per published number: its position is the deviation of the reproduced"
        " value, its shape the status of the comparison. Point at a sign for its number. The axis"
        " is linear up to ±1 % and logarithmic beyond.",
        agreement(scoreboard),
        "scoreboard",
    )


def draws(scoreboard: Scoreboard, folder: Folder) -> ShownFigure | None:
    """Picture of published values among the draws of a random bench; None without draws."""
    svg = draw_strips(scoreboard)
    if svg is None:
        return None
    return folder.picture(
        DrawingFiles.of(svg),
        "Published values among the draws of a random bench",
        "Tick: the bench with another seed of its scatter. Dot: their median. Band: where 95 % of"
        " further draws lie, systematic parts included. The line at 0 is the"
        " published value, itself one draw. Right: share of draws below it.",
        "One strip of ticks per published number, around a line at the published value.",
        "draws",
    )
