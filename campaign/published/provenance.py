"""Whether the trials behind a finding ran on the bench that was described or calibrated.

A status is what a bench says of itself, and that holds for one bench only. So the bench of every
executed trial, as the archive keeps it, is held against the fingerprint that it states: whatever a
hand edit, `--set` or a matrix changed on the way there shows, and only there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import why_altered
from campaign.result import Value
from campaign.trial import Role, Tree, Trial, canonical_json

BENCH = "bench."
"""How a swept path of the bench begins, in the point of a trial."""
OF_A_TRUTH = "its samples are of another bench, the truth"
"""Why a trial that simulated a truth is of no described bench, whatever its stated bench is."""
TOLERANCE = 1e-9
"""Relative; between a point of the sweep and the same number in a finding's conditions."""


@dataclass(frozen=True)
class Place:
    """The trials at one point of a test's sweep with one compensation.

    Attributes:
        altered: why their bench is not the one described; "" when it is.
    """

    point: Mapping[str, Any]
    compensation: str
    altered: str


@dataclass(frozen=True)
class Provenance:
    """What a test's trials ran on, place by place; where there is none, nothing is altered."""

    places: tuple[Place, ...] = ()

    def why_altered(self, conditions: Mapping[str, Value]) -> str:
        """Why a finding with these conditions is of no described bench; "" when it is.

        All trials count that the conditions do not exclude.
        """
        behind = [place for place in self.places if _may_be_behind(place, conditions)]
        return next((place.altered for place in behind or self.places if place.altered), "")


NOTHING_ALTERED = Provenance()


def provenance_of(
    trials: Iterable[Trial],
    *,
    perturbs_bench: bool = False,
    described: Tree | None = None,
    changed: str = "",
) -> Provenance:
    """Hold the benches of a test's executed trials against the fingerprint that they state.

    Args:
        trials: those that were executed; only measurements count.
        perturbs_bench: the experiment changes the bench by itself, on purpose. Then what counts is
            the bench it began with: `described` with what the matrix put into it.
        described: the test's bench before any sweep (SI); None when nobody kept it.
        changed: why the test had more than one bench, whatever each of them is; "" when it had one.
    """
    known: dict[str, str] = {}
    places: dict[str, Place] = {}
    for trial in trials:
        if trial.role is not Role.MEASUREMENT:
            continue
        compensation = trial.task.compensation
        tree: Mapping[str, Any] = trial.bench
        if perturbs_bench and described is not None:
            tree = _at_point(described, trial.point)
        key = canonical_json([tree, compensation, trial.truth])
        if key not in known:
            known[key] = OF_A_TRUTH if trial.truth else _why(tree, compensation)
        place = Place(dict(trial.point), compensation, known[key])
        places.setdefault(canonical_json([place.point, compensation, place.altered]), place)
    found = tuple(places.values())
    if perturbs_bench and described is None and any(not place.altered for place in found):
        # One of its trials is the unperturbed reference, and that is the bench described.
        found = tuple(
            place if place.altered == OF_A_TRUTH else replace(place, altered="") for place in found
        )
    if changed:
        found = tuple(replace(place, altered=place.altered or changed) for place in found)
    return Provenance(found)


def _why(tree: Mapping[str, Any], compensation: str) -> str:
    try:
        bench = Bench.model_validate(tree, context={"si": True})
    except ValueError:
        return "the bench it ran on cannot be read"
    return why_altered(bench, compensation)


def _at_point(tree: Mapping[str, Any], point: Mapping[str, Any]) -> Mapping[str, Any]:
    """A bench with the swept values of the bench put in."""
    for path, value in point.items():
        if path.startswith(BENCH):
            tree = _replaced(tree, path.removeprefix(BENCH).split("."), value)
    return tree


def _replaced(tree: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    below = tree.get(keys[0])
    inside = below if isinstance(below, Mapping) else {}
    return {**tree, keys[0]: value if len(keys) == 1 else _replaced(inside, keys[1:], value)}


def _may_be_behind(place: Place, conditions: Mapping[str, Value]) -> bool:
    if conditions.get("compensation", place.compensation) != place.compensation:
        return False
    shared = place.point.keys() & conditions.keys()
    return all(_same(place.point[name], conditions[name]) for name in shared)


def _same(swept: Any, told: Value) -> bool:
    if isinstance(swept, bool) or isinstance(told, bool):
        return swept is told
    if isinstance(swept, int | float) and isinstance(told, int | float):
        return abs(swept - told) <= TOLERANCE * max(abs(swept), abs(told))
    # A swept table goes by a name in the conditions: any place may be meant.
    return isinstance(swept, dict) or swept == told
