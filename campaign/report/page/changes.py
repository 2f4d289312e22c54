"""The picture of numbers against their references, on the page of whoever compares."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from campaign.references.judged import J, Verdict
from campaign.report.drawing.changes_picture import draw_changes, with_change
from campaign.report.drawing.drawn import Drawn
from campaign.report.page.folder import Folder, ShownFigure


def changes_figure(
    pairs: Sequence[J], names_of: Callable[[Sequence[J]], Sequence[str]], folder: Folder, key: str
) -> ShownFigure | None:
    """Added to the folder; None where no change has an interval.

    `names_of`: of the rows that are shown.
    """
    shown = with_change(pairs)
    if not shown:
        return None
    names = names_of(shown)
    declared = [n for n, p in zip(names, shown, strict=True) if p.verdict is Verdict.DIFFERENT]
    return folder.picture(
        Drawn.of(draw_changes(shown, names)),
        "Changes in percent",
        "Each sign is a number with a reference, the bar the 95 % interval of its change. Filled: "
        "declared different. Hollow: no difference is shown, or it is not judged (diamonds).",
        f"Declared different: {'; '.join(declared)}." if declared else "No difference is declared.",
        key,
    )
