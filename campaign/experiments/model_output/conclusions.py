"""Conclusions on model outputs: largest torque, and torque at the reversal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from campaign.experiments.model_output.figures import UNCHANGED
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    conclusion,
    determined,
    listed,
    setting,
)
from campaign.experiments.shared.friction_models import model_label
from campaign.experiments.shared.model_clauses import MOST, Rows, amount_of
from campaign.result import Cell, Conclusion


def model_output_conclusions(
    rows: Rows, amplitude: float, frequency: float
) -> tuple[Conclusion, ...]:
    """Largest torque and that at the reversal, of each model; of varied ones the farthest.

    rows: with the name of each model in `source`; amplitude (rad/s) and frequency (Hz) of the rate.
    """
    start: Parts = (
        *("At a rate of ", setting(amplitude, "rad/s", "deg/s"), " amplitude and "),
        *(
            setting(frequency, "Hz"),
            ", largest torque and torque where the rate falls through zero: ",
        ),
    )
    unchanged = [row for row in rows if row["source"] == UNCHANGED]
    told = [
        (f"{_source(row)} ", peak, " and ", at)
        for row in unchanged or rows
        if (peak := amount_of(row, "peak")) and (at := amount_of(row, "at_reversal"))
    ]
    return (conclusion(*start, listed(told[:MOST], "; ", "; ")), *_farthest(rows, unchanged))


def _source(row: Mapping[str, Cell]) -> str:
    """The model of a row; of an unchanged one among varied ones its own name."""
    own = row["source"] == UNCHANGED and row.get("model")
    return model_label(str(row["model"])) if own else str(row["source"])


def _farthest(rows: Rows, unchanged: Rows) -> Iterator[Conclusion]:
    """The variation that moves the largest torque most; `unchanged` has a row for each model."""
    moved = [
        (row, peak, base)
        for row in rows
        for same in unchanged
        if row is not same and row.get("model") == same.get("model")
        if (peak := amount_of(row, "peak")) and (base := amount_of(same, "peak"))
        if determined(peak.estimate) and determined(base.estimate)
    ]
    if moved:
        row, peak, base = max(moved, key=lambda e: abs(e[1].estimate.value - e[2].estimate.value))
        yield conclusion(
            "Of all variations the one that moves the largest torque farthest is ",
            *(str(row["source"]), ": ", peak, " in place of ", base),
        )
