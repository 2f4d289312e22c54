"""What virtual experiments on friction models come to: one clause for each model and sweep."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from campaign.estimate import Estimate
from campaign.experiments.conclusions.parts import (
    Parts,
    Settings,
    conclusion,
    count,
    determined,
    listed,
    ratio_of,
    setting,
)
from campaign.experiments.shared.friction_models import Place, model_label
from campaign.result import Amount, Cell, Conclusion, Factor

Rows = Sequence[Mapping[str, Cell]]
UNCHANGED = "unchanged"
"""What a row of varied models says of the model as it is."""
ROUNDING = 1e-12
"""Share of the largest number of a column below which one is a rounding error."""
MOST = 4
"""Most models or places of a sweep that a sentence names."""


def _each(
    rows: Rows,
    places: Sequence[Place],
    settings: Settings,
    tell: Callable[[list[Mapping[str, Cell]]], Parts],
) -> Parts:
    """What is to tell of the rows of each model or place, behind its name."""
    items: list[Parts] = []
    for place in places[:MOST]:
        own = [r for r in rows if all(r.get(k) == v for k, v in place.point.items())]
        if own and (told := tell(own)):
            items.append((*_name(place, settings), *told))
    more = len(places) - MOST
    left: tuple[Parts, ...] = ((f"{count(more, 'more place')} in the table",),) if more > 0 else ()
    return listed((*items, *left), "; ", "; ")


def _name(place: Place, settings: Settings) -> Parts:
    """`LuGre model: `; empty for the bench's own friction."""
    point = dict(place.point)
    model = point.pop("model", None)
    words: list[Parts] = [(model_label(str(model)),)] if model is not None else []
    words += [settings.told(path, value) for path, value in point.items()]
    return (*listed(words, last=", "), ": ") if words else ()


def _amount(row: Mapping[str, Cell], name: str, display: str = "") -> Amount | None:
    cell = row.get(name)
    return Amount(cell, display) if isinstance(cell, Estimate) else None


def _without_rounding(rows: Rows, name: str) -> list[Mapping[str, Cell]]:
    """The rows with 0 in place of what is a rounding error of the column's largest number."""
    found = [cell for row in rows if isinstance(cell := row.get(name), Estimate)]
    largest = max((abs(each.value) for each in found if determined(each)), default=0.0)
    clean = {
        id(each): replace(each, value=0.0)
        for each in found
        if abs(each.value) < ROUNDING * largest and not each.has_interval
    }
    return [{**row, name: clean.get(id(row.get(name)), row.get(name))} for row in rows]


def _set(row: Mapping[str, Cell], name: str, unit: str, display: str = "") -> Amount:
    value = row.get(name)
    return setting(float(value) if isinstance(value, int | float) else 0.0, unit, display)


def _ends(
    rows: list[Mapping[str, Cell]], along: tuple[str, str, str], name: str, display: str = ""
) -> Parts:
    """`1.2 N m at 0.1 N m/s and 0.9 N m at 50 N m/s`: at both ends of a sweep, never between.

    along: what the rows follow, with its unit and the one it is shown in.
    """
    ends = [rows[0], rows[-1]] if len(rows) > 1 else rows
    told = [
        (amount, " at ", _set(r, *along)) for r in ends if (amount := _amount(r, name, display))
    ]
    return listed(told)


def force_rate_conclusions(
    rows: Rows, places: Sequence[Place], settings: Settings
) -> tuple[Conclusion, ...]:
    """Breakaway torque on the slowest and on the fastest ramp, of each model."""

    def tell(own: list[Mapping[str, Cell]]) -> Parts:
        told = _ends(own, ("torque_rate", "N m/s", ""), "breakaway")
        slow, fast = (_amount(row, "breakaway") for row in (own[0], own[-1]))
        if slow is None or fast is None or slow is fast or len(own) < 2:
            return told
        ratio = ratio_of(slow.estimate, fast.estimate)
        return (
            *told,
            ", ",
            Factor(ratio, above="less on the fastest", below="more on the fastest"),
        )

    return (
        conclusion(
            "Breakaway torque by rate of the applied torque: ", _each(rows, places, settings, tell)
        ),
    )


def friction_lag_conclusions(
    rows: Rows, places: Sequence[Place], settings: Settings
) -> tuple[Conclusion, ...]:
    """Width of the loops at the slowest and the fastest swing, of each model."""

    def tell(own: list[Mapping[str, Cell]]) -> Parts:
        return _ends(own, ("frequency", "Hz", ""), "width")

    return (
        conclusion(
            "Friction while the rate rises, less that while it falls, at the mean rate: ",
            _each(_without_rounding(rows, "width"), places, settings, tell),
        ),
    )


def hysteresis_conclusions(
    rows: Rows, places: Sequence[Place], settings: Settings, units: tuple[str, str]
) -> tuple[Conclusion, ...]:
    """Energy and loss factor of the smallest and the largest loop, of each model.

    units: of amplitude and energy, as they are shown.
    """
    amplitude, energy = units

    def tell(own: list[Mapping[str, Cell]]) -> Parts:
        along = ("amplitude", "rad", amplitude)
        told = _ends(own, along, "energy", energy)
        factors = [a for r in (own[0], own[-1])[: len(own)] if (a := _amount(r, "loss_factor"))]
        words = "loss factor " if len(factors) == 1 else "loss factors "
        return (*told, f" ({words}", *listed([(each,) for each in factors]), ")")

    return (
        conclusion("Energy lost in a cycle of displacement: ", _each(rows, places, settings, tell)),
        conclusion("A spring has a loss factor of 0, dry sliding one of 4/π = 1.27"),
    )


def stick_slip_conclusions(
    rows: Rows, places: Sequence[Place], settings: Settings, stiffness: float, pull_rate: float
) -> tuple[Conclusion, ...]:
    """Slips, their period and the largest torque of the spring, of each model.

    The spring's stiffness is in N m/rad, the rate of its far end in rad/s.
    """

    def tell(own: list[Mapping[str, Cell]]) -> Parts:
        row, slips = own[0], own[0].get("slips")
        # Of a recording that lost samples nobody knows how many slips there were.
        counted = isinstance(slips, int | float) and math.isfinite(slips)
        number = setting(float(str(slips))) if counted else None
        named = (
            (number, " slips"),
            ("the first after ", _amount(row, "first_slip")),
            ("then one every ", _amount(row, "period")),
            ("the spring's torque up to ", _amount(row, "peak_torque")),
        )
        return listed([(a, b) for a, b in named if a is not None and b is not None], last=", ")

    spring = ("Pulled at ", setting(pull_rate, "rad/s"), " through a spring of ")
    told = _each(rows, places, settings, tell)
    return (conclusion(*spring, setting(stiffness, "N m/rad"), ", ", told),)


def stribeck_conclusions(
    rows: Rows,
    places: Sequence[Place],
    deviations: Mapping[str, Estimate],
    settings: Settings,
) -> tuple[Conclusion, ...]:
    """Least and largest friction in the positive direction, and how far readings lie off the curve.

    deviations: the largest, by the label of the place.
    """

    def tell(own: list[Mapping[str, Cell]]) -> Parts:
        found = [
            (torque, rate)
            for row in own
            if (torque := _amount(row, "torque")) and (rate := _amount(row, "rate", "deg/s"))
            if determined(torque.estimate) and rate.estimate.value > 0
        ]
        if not found:
            return ("no reading in the positive direction has a torque",)
        found.sort(key=lambda each: abs(each[0].estimate.value))
        (least, slow), (most, fast) = found[0], found[-1]
        return ("from ", least, " at ", slow, " to ", most, " at ", fast)

    off: list[Parts] = [
        ((f"{label}: ", Amount(each, "percent")) if label else (Amount(each, "percent"),))
        for label, each in list(deviations.items())[:MOST]
    ]
    return (
        conclusion(
            "In the positive direction friction of steady sliding is ",
            _each(rows, places, settings, tell),
        ),
        conclusion(
            "In either direction the largest deviation from the model's own curve is ",
            listed(off, "; ", "; "),
        ),
    )


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
        if (peak := _amount(row, "peak")) and (at := _amount(row, "at_reversal"))
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
        if (peak := _amount(row, "peak")) and (base := _amount(same, "peak"))
        if determined(peak.estimate) and determined(base.estimate)
    ]
    if moved:
        row, peak, base = max(moved, key=lambda e: abs(e[1].estimate.value - e[2].estimate.value))
        yield conclusion(
            "Of all variations the one that moves the largest torque farthest is ",
            *(str(row["source"]), ": ", peak, " in place of ", base),
        )


def move_conclusions(rows: Rows) -> tuple[Conclusion, ...]:
    """How far each move ended from the end of its command."""
    told = [
        (_set(row, "target", "rad", "deg"), " was missed by ", off)
        for row in rows
        if (off := _amount(row, "deviation", "deg"))
    ]
    if not told:
        return (conclusion("Where the axis was moved to is not known: no angle was recorded"),)
    more = len(told) - MOST
    left: tuple[Parts, ...] = ((f"{count(more, 'more move')} in the table",),) if more > 0 else ()
    return (conclusion("The end of the command at ", listed((*told[:MOST], *left), "; ", "; ")),)
