"""Excitations of rigs unlike the shipped ones, and what their report tells of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from campaign.axis_kind import axis_terms
from campaign.estimate import Estimate
from campaign.physics.bench import Bench
from campaign.recording import Outcome
from tests.estimation.excited_rigs import THREE
from tests.experiments.laboratory import Done, analyse, execute, trials

SERIES = {"signal": "fourier", "period": "4 s", "periods": 2, "search": 20}
LINES = {"signal": "multisine", "lowest": "1 Hz", "highest": "30 Hz", "period": "2 s"}


def rate(on: Bench, share: float) -> str:
    """That share of the rate limit, as a protocol has it."""
    assert on.limits is not None
    return f"{share * on.limits.rate!r} {'m/s' if on.axis.kind == 'linear' else 'rad/s'}"


def played(on: Bench, options: Mapping[str, Any], first: int) -> tuple[Done, ...]:
    """Trials with numbers and seeds from `first` on. Raises ValueError where one fails."""
    with axis_terms(on.sides):
        made = [
            each.model_copy(update={"number": first + k, "seed": first + k})
            for k, each in enumerate(trials("excitation", on, dict(options)), start=1)
        ]
        done = execute(made)
    for each in done:
        if each.ending.outcome is not Outcome.COMPLETED:
            raise ValueError(each.ending.reason)
    return done


def by_series(name: str, seed: int) -> list[Estimate]:
    """What the report tells of inertia and friction of one of three rigs."""
    return series(THREE[name](), seed)


def series(on: Bench, seed: int) -> list[Estimate]:
    """The same of any. Raises ValueError where a trial fails."""
    options = {**SERIES, "max_rate": rate(on, 0.5), "seed": seed}
    with axis_terms(on.sides):
        result = analyse("excitation", played(on, options, 5000 * seed))
    return [each.known for each in result.findings]


def by_lines(name: str, seed: int) -> list[Estimate]:
    """What the report tells of distortion."""
    on = THREE[name]()
    with axis_terms(on.sides):
        result = analyse("excitation", played(on, {**LINES, "seed": seed}, 5000 * seed))
    return [each.known for each in result.findings]


def true_dynamics(on: Bench) -> Mapping[str, float]:
    (load,) = on.friction.values()
    other = load.negative.coulomb_torque if load.negative is not None else None
    return {
        "inertia": cast("float", on.axis.inertia),
        "viscous": load.viscous_friction,
        "coulomb_positive": load.coulomb_torque,
        "coulomb_negative": load.coulomb_torque if other is None else other,
    }
