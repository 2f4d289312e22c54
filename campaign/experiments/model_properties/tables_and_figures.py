"""Tables and figures of model properties."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from campaign.channels import FRICTION_TORQUE, LOAD_RATE, RELATIVE_ANGLE
from campaign.experiments.interface import TestData, TrialData, with_samples
from campaign.experiments.model_properties.rules import (
    DEPENDS,
    MARKS,
    MET,
    PARTLY,
    RULES,
    ModelVerdict,
    Rule,
)
from campaign.result import Axis, Column, Curve, Figure, Panel, Table

ENDS = 1e-2, 1e2
"""Ends of the axis of a number over its threshold; numbers beyond are drawn there."""


def tables(
    found: Sequence[ModelVerdict], sets: Mapping[str, Mapping[str, Any]]
) -> tuple[Table, ...]:
    """Marks by property and model; numbers behind them; rules; sizes of models; parameter sets."""
    models = [Column(each.model, each.model) for each in found]
    text = Column("property", "Property", exact=True)
    return (
        Table(
            "model-properties",
            "Properties of friction models",
            (text, *models),
            tuple(
                {"property": rule.name, **{each.model: each.sign(rule) for each in found}}
                for rule in RULES
            ),
            thesis=("3.1",),
            note="+: met, o: partly, –: not, by the rules below, for all parameter sets. A model "
            "has no parameter that the equations of its source lack.",
        ),
        Table(
            "model-properties-numbers",
            "Numbers that decide, over their thresholds",
            (
                text,
                Column("set", "Parameter set", exact=True),
                *(Column(each.model, each.model, exact=True) for each in found),
            ),
            tuple(
                {
                    "property": rule.name,
                    "set": name,
                    **{each.model: _share(each.numbers[name][rule.shows], rule) for each in found},
                }
                for rule in RULES
                for name in found[0].numbers
            ),
            note="1 and above: met, if the further condition of the rule holds; from 0.5: partly. "
            f"Larger numbers than {ENDS[1]:g} are shown as {ENDS[1]:g}.",
        ),
        Table(
            "model-properties-rules",
            "Rules, and models that have the property and lack it for certain",
            (
                text,
                Column("rule", "Rule", exact=True),
                Column("positive", "Positive control", exact=True),
                Column("negative", "Negative control", exact=True),
            ),
            tuple(
                {
                    "property": rule.name,
                    "rule": rule.text,
                    "positive": rule.positive,
                    "negative": rule.negative,
                }
                for rule in RULES
            ),
        ),
        Table(
            "model-sets",
            "Parameter sets",
            (
                Column("parameter", "Parameter", exact=True),
                *(Column(name, name, exact=True) for name in sets),
            ),
            tuple(
                {"parameter": key, **{name: given.get(key) for name, given in sets.items()}}
                for key in dict.fromkeys(key for given in sets.values() for key in given)
            ),
            note="A model takes the parameters that it has. Ts, Tc, vs, σ0 and σ2 of `model` scale "
            "the experiments.",
        ),
        Table(
            "model-sizes",
            "Size of friction models",
            (
                Column("model", "Model", exact=True),
                Column("parameters", "Parameters", exact=True),
                Column("state", "Numbers of state", exact=True),
                Column("switches", "Switch functions", exact=True),
            ),
            tuple({"model": each.model, **each.sizes} for each in found),
            note="Parameters: those of the first set that the model takes; others have defaults. "
            "Switch functions of rate, state and torque: where one passes zero the equations "
            "change, and an integrator with a variable step has an event. The cost of a step "
            "depends on the machine, so it is not measured here: docs/friction-models.md.",
        ),
    )


def _share(value: float, rule: Rule) -> float:
    """A number over its threshold, to three digits, up to the end of the figure's axis."""
    share = min(value / rule.threshold, ENDS[1])
    return 0.0 if abs(share) < 1e-3 else float(f"{share:.3g}")


def figures(found: Sequence[ModelVerdict], data: TestData) -> tuple[Figure, ...]:
    """Marks, numbers over thresholds, and loops in presliding and around a rate (first set)."""
    first = next(iter(found[0].numbers))
    own = [item for item in with_samples(data.completed()) if item.trial.point["set"] == first]
    loops = [
        _loops(
            found, _longest(own, "presliding"), (RELATIVE_ANGLE, "Displacement", "rad", "urad"),
            ("model-presliding", "Friction in presliding",
             f"Displacement to and fro, with an inner loop; set {first}."),
        ),
        _loops(
            found, _longest(own, "swing"), (LOAD_RATE, "Rate", "rad/s", "mrad/s"),
            ("model-lag", "Friction around a positive rate",
             f"The last cycle at the highest frequency; set {first}."),
        ),
    ]  # fmt: skip
    return (_matrix(found), _decisions(found), *(figure for figure in loops if figure.panels))


def _matrix(found: Sequence[ModelVerdict]) -> Figure:
    """Marks of all models by property."""
    models = [each.model.replace("-", "-\n") for each in found]
    looks = {
        MARKS[MET]: ("met", "measured"),
        MARKS[PARTLY]: ("partly", "alternative"),
        DEPENDS: ("depends on the parameters", "reference"),
    }
    curves = []
    for sign, (label, series) in looks.items():
        at = [
            (k, -row)
            for row, rule in enumerate(RULES)
            for k, each in enumerate(found)
            if each.sign(rule) == sign
        ]
        if at:
            x, y = np.array(at, dtype=float).T
            curves.append(Curve(x, y, label, series, "points"))
    names = tuple((float(-row), rule.name) for row, rule in enumerate(RULES))
    return Figure(
        key="model-marks",
        title="Properties of friction models",
        caption="A mark where a model has a property for all parameter sets, has it partly, or for "
        "some of the sets.",
        alt="A row per property, a column per model, and a mark where the model has it.",
        panels=(
            Panel(
                Axis(
                    "",
                    places=tuple((float(k), name) for k, name in enumerate(models)),
                    limits=(-0.5, len(models) - 0.5),
                ),
                Axis("", places=names, limits=(0.5 - len(RULES), 0.5)),
                curves,
            ),
        ),
    )


def _decisions(found: Sequence[ModelVerdict]) -> Figure:
    places = tuple((float(-k), each.model) for k, each in enumerate(found))
    at = np.array([place for place, _ in places])

    def panel(rule: Rule) -> Panel:
        ends = (0.6 - len(found), 0.6)
        curves = [
            Curve(np.full(2, 1.0), np.array(ends), "met from here on", "reference"),
            Curve(np.full(2, 0.5), np.array(ends), "partly met from here on", "alternative"),
        ]
        for k, name in enumerate(found[0].numbers):
            over = [each.numbers[name][rule.shows] / rule.threshold for each in found]
            curves.append(Curve(np.clip(over, *ENDS), at - 0.25 + 0.25 * k, name, name, "points"))
        return Panel(
            Axis("Number over its threshold", scale="log", limits=(0.7 * ENDS[0], 1.4 * ENDS[1])),
            Axis("", places=places, limits=ends),
            curves,
            rule.name.capitalize(),
        )

    return Figure(
        key="model-properties",
        title="Criteria for the properties of each model",
        caption="Numbers over their thresholds, by parameter set. Right of the line at 1 a "
        "property is met, if its further condition holds; between the lines it is met partly. "
        f"Numbers below {ENDS[0]:g} or above {ENDS[1]:g} are drawn there.",
        alt="One panel per property: a row per model, a dot per parameter set.",
        panels=tuple(map(panel, RULES)),
        across=3,
    )


def _longest(items: Sequence[TrialData], part: str) -> Iterator[TrialData]:
    """The trial of a part for each model; of several the one with the highest frequency."""
    best: dict[object, TrialData] = {}
    for item in items:
        point = item.trial.point
        if point["part"] == part:
            model, other = point["model"], best.get(point["model"])
            if other is None or _frequency(item) > _frequency(other):
                best[model] = item
    yield from best.values()


def _frequency(item: TrialData) -> float:
    return float(str(item.trial.point.get("frequency", 0.0)))


def _loops(
    found: Sequence[ModelVerdict],
    items: Iterator[TrialData],
    along: tuple[str, str, str, str],
    words: tuple[str, str, str],
) -> Figure:
    """Friction over a channel, a panel for each model.

    along: channel, label, unit and shown unit; words: key, title and caption.
    """
    channel, label, unit, display = along
    key, title, caption = words
    known = {each.model for each in found}
    shown = [item for item in items if item.trial.point["model"] in known]
    panels = []
    for item in shown:
        recording, model = item.recording(), str(item.trial.point["model"])
        window = recording.window(*item.trial.task.window)
        panels.append(
            Panel(
                Axis(label, unit, display),
                Axis("Friction torque", "N m"),
                [Curve(window[channel], window[FRICTION_TORQUE], "", "measured")],
                model,
            )
        )
    return Figure(
        key=key,
        title=title,
        caption=caption,
        alt=f"{title}: one panel per model.",
        panels=tuple(panels),
        across=4,
        trials=tuple(item.trial.number for item in shown),
    )
