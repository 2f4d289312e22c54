"""Whether trials ran on the described or calibrated bench.

A status is what a bench says of itself, and that holds for one bench only. So the bench of every
executed trial, as the archive keeps it, is held against the fingerprint that it states: whatever a
hand edit, `--set` or a matrix changed on the way there shows, and only there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import STATED, why_altered
from campaign.published.draws import SEED
from campaign.result import Value
from campaign.trial import Role, Tree, Trial, canonical_json

BENCH = "bench."
"""How a swept path of the bench begins, in the point of a trial."""
OF_A_TRUTH = (
    "the samples are of a truth, which was simulated in place of the bench that is stated; what the"
    " stated one was made from and fitted to says nothing of them"
)
"""Why a trial that simulated a truth is of no described bench, whatever its stated bench is."""
DESCRIBED_TWICE = "its trials state different descriptions of their bench"
"""Why a test has no one bench, whatever each of them is."""
TOLERANCE = 1e-9
"""Relative; between a point of the sweep and the same number in a finding's conditions."""


@dataclass(frozen=True)
class SweepPoint:
    """The trials at one point of a test's sweep with one compensation.

    Attributes:
        altered: why their bench is not the one described; "" when it is.
        described: whether their bench says at all what it was made from.
        numbers: those among their options (SI).
        failed: whether one of them did not complete.
    """

    point: Mapping[str, Any]
    compensation: str
    altered: str
    described: bool = True
    numbers: Mapping[str, Any] = field(default_factory=dict)
    failed: bool = False


@dataclass(frozen=True)
class Provenance:
    """What a test's trials ran on, place by place; where there is none, nothing is altered."""

    places: tuple[SweepPoint, ...] = ()

    def why_altered(self, conditions: Mapping[str, Value]) -> str:
        """Why a finding with these conditions is of no described bench; "" when it is.

        All trials count that the conditions do not exclude.
        """
        return next((place.altered for place in self._behind(conditions) if place.altered), "")

    def is_described(self, conditions: Mapping[str, Value]) -> bool:
        """Whether every bench behind such a finding says what it was made from."""
        return all(place.described for place in self._behind(conditions))

    def _behind(self, conditions: Mapping[str, Value]) -> Sequence[SweepPoint]:
        behind = [place for place in self.places if _may_be_behind(place, conditions)]
        return behind or self.places

    @property
    def seeds(self) -> frozenset[Value]:
        """Draws of a random bench that were executed, where the test sweeps them."""
        return frozenset(place.point[SEED] for place in self.places if SEED in place.point)


NOTHING_ALTERED = Provenance()


def provenance_of(
    trials: Iterable[Trial],
    *,
    perturbs_bench: bool = False,
    described: Tree | None = None,
    changed: str = "",
    failed: Collection[int] = (),
) -> Provenance:
    """Hold the benches of a test's executed trials against the fingerprint that they state.

    Args:
        trials: those that were executed; only measurements count.
        perturbs_bench: the experiment changes the bench by itself, on purpose. Then what counts is
            the bench it began with: `described` with what the matrix put into it.
        described: the test's bench before any sweep (SI); None when nobody kept it.
        changed: why the test had more than one bench, whatever each of them is; "" when it had one.
        failed: numbers of the trials that did not complete.

    A sweep of the seed of the bench's scatter alters nothing where the bench's own is among the
    draws: they say how draws lie apart. Any other seed in its place may have been chosen by what
    it gives.
    """
    measured = [trial for trial in trials if trial.role is Role.MEASUREMENT]
    if len({canonical_json(_description(trial.bench)) for trial in measured}) > 1:
        changed = changed or DESCRIBED_TWICE
    known: dict[str, tuple[str, bool]] = {}
    places: dict[str, SweepPoint] = {}
    drawn = {trial.point.get(SEED) for trial in measured}
    own = _own_seed(described)
    for trial in measured:
        compensation = trial.task.compensation
        tree: Mapping[str, Any] = trial.bench
        if described is not None and perturbs_bench:
            tree = _at_point(described, trial.point)
        if described is not None and len(drawn) > 1 and own in drawn:
            tree = _with_seed(tree, own)  # several draws of its scatter are that bench
        key = canonical_json([tree, compensation, trial.truth])
        if key not in known:
            why, described_at_all = _why(tree, compensation)
            known[key] = OF_A_TRUTH if trial.truth else why, described_at_all
        numbers = {name: v for name, v in trial.options.items() if isinstance(v, int | float)}
        lost = trial.number in failed
        place = SweepPoint(dict(trial.point), compensation, *known[key], numbers, lost)
        places.setdefault(canonical_json([place.point, compensation, *known[key], lost]), place)
    found = tuple(places.values())
    if perturbs_bench and described is None and any(not place.altered for place in found):
        # One of its trials is the unperturbed reference, and that is the bench described.
        found = tuple(
            place if place.altered == OF_A_TRUTH else replace(place, altered="") for place in found
        )
    if changed:
        found = tuple(replace(place, altered=place.altered or changed) for place in found)
    return Provenance(found)


def _why(tree: Mapping[str, Any], compensation: str) -> tuple[str, bool]:
    """Why a bench is not the one described, and whether it says what it was made from."""
    try:
        bench = Bench.model_validate(tree, context={"si": True})
    except ValueError:
        return "the bench it ran on cannot be read", False
    return why_altered(bench, compensation), bench.known.describes


def _at_point(tree: Mapping[str, Any], point: Mapping[str, Any]) -> Mapping[str, Any]:
    """A bench with the swept values of the bench put in."""
    for path, value in point.items():
        if path.startswith(BENCH):
            tree = _replaced(tree, path.removeprefix(BENCH).split("."), value)
    return tree


def _description(bench: Mapping[str, Any]) -> Any:
    """What a bench says it was made from, and of which bench that is said."""
    known = bench.get("known")
    if not isinstance(known, Mapping):
        return None
    return [known.get(name) for name in (*STATED, "fingerprint")]


def _own_seed(described: Tree | None) -> int:
    variation = (described or {}).get("variation")
    seed = variation.get("seed") if isinstance(variation, Mapping) else None
    return seed if isinstance(seed, int) else 0


def _with_seed(tree: Mapping[str, Any], seed: int) -> Mapping[str, Any]:
    variation = tree.get("variation")
    if not isinstance(variation, Mapping):
        return tree
    return {**tree, "variation": {**variation, "seed": seed}}


def _replaced(tree: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    below = tree.get(keys[0])
    inside = below if isinstance(below, Mapping) else {}
    return {**tree, keys[0]: value if len(keys) == 1 else _replaced(inside, keys[1:], value)}


def _may_be_behind(place: SweepPoint, conditions: Mapping[str, Value]) -> bool:
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
