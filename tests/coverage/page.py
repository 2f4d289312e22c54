"""Tables of coverages, and the picture of all estimates for `docs/trust.md`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.coverage.benches import BENCHES
from tests.coverage.judging import Entry, Pooled, pooled

DOCS = Path(__file__).parents[2] / "docs"
PICTURE = DOCS / "images" / "coverage.png"
TITLES = {
    "velocity_map": "Friction-velocity map",
    "breakaway": "Breakaway and presliding",
    "frequency_response": "Frequency response",
    "stabilization": "Stabilization",
}


def tables(found: Sequence[Entry]) -> str:
    """Markdown, a table for each experiment."""
    groups = pooled(found)
    lines = []
    for kind, title in TITLES.items():
        own = [group for group in groups if group.kind == kind]
        if not own:
            continue
        benches = len({entry.bench for entry in found if entry.kind == kind})
        draws = len({entry.draw for entry in found if entry.kind == kind})
        lines += [f"### {title}", "", f"Benches: {benches}; draws of each: {draws}.", "", _HEAD]
        lines += [_line(group) for group in own] + [""]
    return "\n".join(lines)


_HEAD = (
    "| parameter | holds the truth | of | as reported | bias | half-width |"
    " over the bound | not determined | without interval |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
)


def _line(group: Pooled) -> str:
    low, high = group.interval
    verdict = " **too seldom**" if group.short else " (too wide)" if group.too_wide else ""
    covered = f"{group.coverage:.0%} [{low:.0%}, {high:.0%}]{verdict}" if group.of else "–"
    right, reported = group.reported
    combined = f"{right / reported:.0%}" if reported else "–"
    bias = "–" if group.median_bias is None else f"{group.median_bias:+.2f}"
    width = "–" if group.half_width is None else f"{100 * group.half_width:.2g} %"
    wider = "–" if group.wider is None else f"{group.wider:.2f}"
    hidden, telling = group.hidden
    unknown = f"{group.undetermined}" + (f" ({hidden} of {telling})" if telling else "")
    name = group.parameter.replace("_", " ")
    return (
        f"| {name} | {covered} | {group.of} | {combined} | {bias} | {width} | {wider} |"
        f" {unknown} | {group.without} |"
    )


def draw_picture(found: Sequence[Entry]) -> None:
    """Distance from the truth over the half-width, of every estimate, by parameter and bench."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot as plt

    names = list(dict.fromkeys((e.kind, e.parameter) for e in found if e.bias is not None))
    if not names:
        return
    figure, axes = plt.subplots(figsize=(6.9, 0.28 * len(names) + 1.0), layout="constrained")
    for row, name in enumerate(names):
        own = [e for e in found if (e.kind, e.parameter) == name and e.bias is not None]
        x = [max(-3.0, min(3.0, e.bias or 0.0)) for e in own]
        y = [row + 0.7 * (e.bench / BENCHES - 0.5) for e in own]
        inside = [abs(value) <= 1.0 for value in x]
        axes.scatter(
            x, y, s=5, c=["#1b6ca8" if good else "#c0392b" for good in inside], linewidths=0
        )
    axes.axvspan(-1.0, 1.0, color="0.9", zorder=0)
    axes.set_yticks(range(len(names)), [parameter.replace("_", " ") for _, parameter in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlim(-3.1, 3.1)
    axes.tick_params(labelsize=7)
    axes.set_xlabel("found less true, over the half-width (beyond 3: at the edge)", fontsize=8)
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, dpi=120)
    plt.close(figure)
