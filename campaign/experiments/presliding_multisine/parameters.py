"""Parameters from small motions: stiffness, damping, inertia.

Estimates are the sums over all interfaces, before any of them slips. With one interface, the sum is
a number of the bench. With several, only the sum is known, and a bench file has no key for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from campaign.estimate import Estimate
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import shifted_by
from campaign.estimation.presliding_dynamics.fit_result import unexplained
from campaign.estimation.presliding_dynamics.presliding_fit import PreslidingDynamics
from campaign.estimation.presliding_dynamics.record import Record
from campaign.experiments.interface import TestData
from campaign.experiments.presliding_multisine.dynamics import viscous_of
from campaign.experiments.presliding_multisine.small_motions import records_of, usable
from campaign.experiments.shared.common import correlations
from campaign.experiments.shared.recorded_motion import validation_of
from campaign.parameter import IdentifiedRig, Parameter, Unseen
from campaign.physics.bench import Bench
from campaign.reason import Cause
from campaign.result import Column, Table

WITH_NOISE = Cause("noise of the sensor", "noise of the sensor is in it")
MEANINGS = {
    "stiffness_at_rest": "Slope of friction over angle before any interface slips, of all of them.",
    "damping_at_rest": "Damping of small motions, bristles' and viscous friction's together.",
    "bristle_damping": "Damping of the bristles: that of small motions less viscous friction.",
    "inertia": "What resists acceleration.",
    "damping_ratio": "Damping of small motions over the critical one.",
    "natural_frequency": "Frequency at which the load swings on its bristles.",
    "appendage_frequency": "Frequency of the elastic part when the load is held.",
    "appendage_inertia": "Inertia of the elastic part.",
    "appendage_damping_ratio": "Damping ratio of the elastic part when the load is held.",
}
KEYS = {
    "inertia": "axis.inertia",
    "appendage_frequency": "appendage.frequency",
    "appendage_inertia": "appendage.inertia",
    "appendage_damping_ratio": "appendage.damping_ratio",
}
ADVICE = {
    "inertia": "shake with more lines above the resonance, or longer",
    "stiffness_at_rest": "shake with more lines below the resonance, or longer",
    "damping": "shake with more lines around the resonance, or longer",
    "bristle_damping": "know viscous friction better, by a velocity map",
    "appendage": "shake with more lines around its frequency, or longer",
    "natural_frequency": "shake with more lines around it, or longer",
}
"""What to measure for a better estimate, by the beginning of its name."""


def identified(
    data: TestData, found: PreslidingDynamics, told: dict[str, Estimate], planned: bool
) -> tuple[IdentifiedRig, Table, tuple[str, ...]]:
    """Parameters, what the model leaves over of each trial, and notes.

    planned: whether the trials are planned small motions. Raises ValueError if the validation has
    none.
    """
    bench = data.bench
    told = told | _bristle_damping(told, bench, data.model.viscous_friction)
    unseen = records_of(validation_of(data, usable))
    missed = [unexplained(found.fit, each) for each in unseen]
    return (
        IdentifiedRig(
            tuple(_parameters(told, bench, planned or _gives_way(found))),
            correlations=_correlations(found),
            unseen=Unseen(max(missed), "motion") if missed else None,
        ),
        _missed_table(found, unseen, missed),
        tuple(_notes(bench, found, planned)),
    )


def _bristle_damping(
    told: dict[str, Estimate], bench: Bench, viscous_friction: float | None
) -> dict[str, Estimate]:
    """sigma1: the damping of small motions minus the viscous friction."""
    whole = told.get("damping_at_rest")
    if whole is None:
        return {}
    viscous = viscous_of(bench) if viscous_friction is None else viscous_friction
    own = replace(
        whole,
        name="bristle_damping",
        value=whole.value - viscous,
        low=None if whole.low is None else whole.low - viscous,
        high=None if whole.high is None else whole.high - viscous,
    )
    if not own.has_interval:
        return {own.name: own}
    key = _interface(bench)
    known = bench.known_uncertainty(f"friction.{key}.viscous_friction") if key else None
    return {own.name: admitted(shifted_by(own, "viscous friction", known))}


def _interface(bench: Bench) -> str:
    """The only interface of a bench, if it acts at the load and has bristles; else ""."""
    if len(bench.friction) != 1:
        return ""
    ((name, options),) = bench.friction.items()
    at_load = bench.at_load(options) == (1.0, 1.0)
    return name if at_load and hasattr(options, "bristle_stiffness") else ""


def _gives_way(found: PreslidingDynamics) -> bool:
    """Whether the stiffness surely falls with torque, as of bristles and not of a spring."""
    yielding = found.estimates.get("yielding")
    if yielding is None or not yielding.has_interval:
        return False
    low, _ = yielding.combined
    return low is not None and low > 0


def _parameters(told: dict[str, Estimate], bench: Bench, bristles: bool) -> Iterator[Parameter]:
    """Parameters; `bristles`: whether friction is known to hold the load."""
    keys, own = dict(KEYS), _interface(bench)
    if own and bristles:
        keys["stiffness_at_rest"] = f"friction.{own}.bristle_stiffness"
        keys["bristle_damping"] = f"friction.{own}.bristle_damping"
    for name, meaning in MEANINGS.items():
        if name not in told or math.isnan(told[name].value):
            continue
        one = told[name]
        key = keys.get(name, "") if one.has_interval else ""
        advice = next((text for part, text in ADVICE.items() if name.startswith(part)), "")
        yield Parameter(one, meaning, bench=key, advice=advice)


def _missed_table(
    found: PreslidingDynamics, unseen: Sequence[Record], missed: Sequence[float]
) -> Table:
    fitted = found.fit.records
    rows = [(each, "fitted", unexplained(found.fit, each)) for each in fitted]
    rows += [(each, "unseen", share) for each, share in zip(unseen, missed, strict=True)]
    return Table(
        "presliding-missed",
        "Residual of the fitted model by trial",
        (
            Column("trial", "Trial"),
            Column("use", "Use"),
            Column("amplitude", "Largest torque", "N m", "N m", exact=True),
            Column("missed", "Missed", "", "percent", reason=WITH_NOISE()),
        ),
        tuple(
            {
                "trial": record.named,
                "use": use,
                "amplitude": record.amplitude,
                "missed": share,
            }
            for record, use, share in rows
        ),
        note="Rms of measured less simulated motion over that of the motion. Of unseen trials "
        "nothing was fitted but the sensor's offset and drift.",
    )


def _notes(bench: Bench, found: PreslidingDynamics, planned: bool) -> Iterator[str]:
    if not planned:
        yield (
            "These were not planned as small motions. Noise of the recorded torque raises "
            "stiffness, damping and inertia by about its share of the torque's power."
        )
    if not planned and not _gives_way(found):
        yield (
            "What holds the load is not seen to give way as bristles do: a spring, a cable or "
            "gravity would look the same. Stiffness and damping go to no bench file."
        )
    if len(bench.friction) > 1:
        yield (
            f"The bench states {len(bench.friction)} interfaces. Before the first of them slips a "
            "motion shows only the sum of their stiffness and of their damping; what each of them "
            "has goes to no bench file."
        )


def _correlations(found: PreslidingDynamics) -> dict[tuple[str, str], float]:
    """Correlations by parameter names; the bristles' damping has those of all damping."""
    names = {"bristle_stiffness": "stiffness_at_rest", "damping": "bristle_damping"}
    own = [names.get(each, each) for each in found.fit.parameters.names]
    return correlations(own, found.spread.correlation)
