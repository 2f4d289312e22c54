"""The figure of changes against references."""

from __future__ import annotations

from collections.abc import Sequence

from campaign.references.verdict import JudgedNumber, Verdict
from campaign.report.drawing.changes_picture import draw_changes, with_change
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.page.folder import Folder, ShownFigure


def changes_figure(
    pairs: Sequence[tuple[JudgedNumber, str]], folder: Folder, key: str
) -> ShownFigure | None:
    """Pairs with their names, those declared different first; None without a change to draw."""
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
