"""Steady stretches as a table, figures and sentences, of a report and of an identification."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.intervals import multiplied
from campaign.experiments.friction_map.over_rate import COEFFICIENT, FRICTION, Mapped
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.sliding import Sliding, scaled
from campaign.experiments.friction_map.stretches import Point
from campaign.experiments.shared.conclusion_parts import count
from campaign.reason import Cause
from campaign.result import (
    Amount,
    Axis,
    Cell,
    Column,
    Conclusion,
    Curve,
    Figure,
    Panel,
    Table,
    ends_of,
)

FINE = 100
"""Rates at which a fitted curve is drawn."""
MEAN_OF_STRETCH = Cause("mean of a stretch", "mean of the stretch")
RATE = Axis("Rate", "rad/s", "deg/s")
SPEED = Axis("Speed", "rad/s", "deg/s")


def coefficient_of(sliding: Sliding, point: Point) -> Estimate:
    """Friction over normal load, positive against the motion, with what no stretch shows."""
    return scaled(multiplied(point.coefficient, point.sign), COEFFICIENT, sliding.first)


def stretch_table(sliding: Sliding, suffix: str = "", of: str = "") -> Table:
    """Each steady stretch in order of time, and those that are not steady."""
    every = sorted((*sliding.points, *sliding.left), key=lambda point: (point.trial, point.first))
    several = len({point.trial for point in every}) > 1
    pressed = any(np.isfinite(point.normal_load) for point in every)
    rows: list[dict[str, Cell]] = []
    for number, point in enumerate(every, start=1):
        row: dict[str, Cell] = {
            "stretch": number,
            "trial": point.trial,
            "first": point.first,
            "last": point.last,
            "rate": point.own.rate,
            "torque": scaled(point.own.torque, FRICTION, sliding.first),
            "left_out": str(point.own.unsteady),
        }
        if np.isfinite(point.normal_load):
            row["load"] = point.normal_load
        if np.isfinite(point.load):
            row["coefficient"] = coefficient_of(sliding, point)
        rows.append(row)
    more = (
        Column("load", "Normal load", "N", "N", reason=MEAN_OF_STRETCH()),
        Column("coefficient", "Friction coefficient"),
    )
    columns = (
        Column("stretch", "Stretch", exact=True),
        *((Column("trial", "Trial", exact=True),) if several else ()),
        Column("first", "From", "s", "s", exact=True),
        Column("last", "To", "s", "s", exact=True),
        Column("rate", "Rate", "rad/s", "deg/s"),
        Column("torque", "Friction torque", "N m", "N m"),
        *(more if pressed else ()),
        *((Column("left_out", "Left out"),) if sliding.left else ()),
    )
    kept = {column.name for column in columns}
    named = tuple({name: cell for name, cell in row.items() if name in kept} for row in rows)
    title = f"Steady stretches{f' of {of}' if of else ''}"
    return Table(f"steady-stretches{suffix}", title, columns, named)


def rate_panels(sliding: Sliding, mapped: Mapped) -> tuple[Panel, ...]:
    """Stretches and what was fitted to them, with their signs and both directions on each other."""
    curves: list[Curve] = []
    against: list[Curve] = []
    quantity = mapped.quantity
    for name, sign in DIRECTIONS.items():
        own = [point for point in sliding.points if point.sign == sign]
        if not own:
            continue
        rate = np.array([point.own.rate.value for point in own])
        label = f"{name} direction"
        read = [scaled(quantity.read(point), quantity, sliding.first) for point in own]
        curves.append(Curve.of(rate, read, label, name))
        ends = np.array([sorted(sign * end for end in ends_of(each)) for each in read])
        values = sign * np.array([each.value for each in read])
        low, high = ends[:, 0], ends[:, 1]
        against.append(Curve(sign * rate, values, label, name, "points", low=low, high=high))
        speed = np.geomspace(np.abs(rate).min(), np.abs(rate).max(), FINE)
        if (curve := mapped.curve(name, speed)) is None:
            continue
        middle, low, high = curve
        edges = (low, high) if sign > 0 else (-high, -low)
        whole = Curve(sign * speed, sign * middle, "", name, low=edges[0], high=edges[1])
        curves.append(whole)
        against.append(Curve(speed, middle, "", name, low=low, high=high))
    what = quantity.axis[0]
    return (
        Panel(RATE, Axis(*quantity.axis), curves, f"{what} of steady stretches"),
        Panel(
            SPEED,
            Axis(f"{what}, in its direction", *quantity.axis[1:]),
            against,
            "Both directions",
        ),
    )


def rate_caption(sliding: Sliding, mapped: Mapped) -> str:
    """What `rate_panels` shows."""
    shown = count(len(sliding.points), "steady stretch", "steady stretches")
    fitted = "Lines: what was fitted to each direction, with its 95 % band; "
    return (
        f"Mean {mapped.quantity.axis[0].lower()} of {shown} over the mean rate. "
        f"{fitted if mapped.fits or mapped.lines else ''}bars: "
        "95 % of each stretch alone, without what differs between them."
    )


def sliding_figure(sliding: Sliding, mapped: Mapped) -> Figure:
    """One quantity over rate."""
    what = mapped.quantity.axis[0]
    return Figure(
        key="map" if mapped.quantity is FRICTION else "coefficient",
        title=f"{what} over rate",
        caption=rate_caption(sliding, mapped),
        alt=f"{what} over rate in both directions: a dot for each steady stretch, and curves.",
        panels=rate_panels(sliding, mapped),
        across=2,
    )


def sliding_conclusions(
    found: Mapping[str, Mapping[str, Estimate]], who: str = ""
) -> Iterator[Conclusion]:
    """Of each direction; `who` begins each sentence."""
    for way, by_name in found.items():
        parts: list[str | Amount] = []
        if "coulomb_torque" in by_name:
            parts += ["Coulomb friction is ", Amount(by_name["coulomb_torque"], "N m")]
            viscous = by_name["viscous_friction"]
            parts += [" and viscous friction ", Amount(viscous, "N m s/rad")]
        elif "friction" in by_name:
            parts += ["friction at the speeds there are is ", Amount(by_name["friction"], "N m")]
        for beginning, of in (("coulomb", " of fast sliding"), ("friction", "")):
            if (ratio := by_name.get(f"{beginning}_coefficient")) is not None:
                before = ", and " if parts else ""
                parts += [f"{before}the coefficient of friction{of} is ", Amount(ratio, "")]
        if parts:
            start = f"sliding steadily in the {way} direction, "
            yield Conclusion((f"{who}{start}" if who else start.capitalize(), *parts, "."))
