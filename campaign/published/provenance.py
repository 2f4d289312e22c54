"""Whether trials ran on the described or calibrated bench.

A bench states its own origin, and this statement applies to one bench only. Therefore the archived
bench of every executed trial is compared with the fingerprint that it states. The comparison shows
every change by a hand edit, `--set` or a matrix.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import STATED, why_altered
from campaign.published.draws import SEED
from campaign.result import Value, allow
from campaign.trial import Role, Tree, Trial, canonical_json

BENCH = "bench."
"""Prefix of a swept path of the bench, in the point of a trial."""
OF_A_TRUTH = (
    "the samples are of a truth, which was simulated in place of the bench that is stated; what the"
    " stated one was made from and fitted to says nothing of them"
)
"""Reason why a trial that simulates a truth is altered, for any stated bench."""
DESCRIBED_TWICE = "its trials state different descriptions of their bench"
"""Reason why a test does not have one bench."""


@dataclass(frozen=True)
class SweepPoint:
    """The trials at one point of a test's sweep with one compensation.

    Attributes:
        altered: reason why their bench is not the described one; "" when it is.
        described: whether their bench states its origin.
        numbers: numeric options of the trials (SI).
        failed: whether they did not complete.
    """

    point: Mapping[str, Any]
    compensation: str
    altered: str
    described: bool = True
    numbers: Mapping[str, Any] = field(default_factory=dict)
    failed: bool = False


@dataclass(frozen=True)
class Provenance:
    """Benches of a test's trials by sweep point; without points nothing is altered."""

    places: tuple[SweepPoint, ...] = ()

    def why_altered(self, conditions: Mapping[str, Value]) -> str:
        """Reason why a finding with these conditions is of an altered bench; "" if it is not.

        All trials that the conditions do not exclude count.
        """
        return next((place.altered for place in self._behind(conditions) if place.altered), "")

    def is_described(self, conditions: Mapping[str, Value]) -> bool:
        """Whether every bench behind a finding with these conditions states its origin."""
        return all(place.described for place in self._behind(conditions))

    def _behind(self, conditions: Mapping[str, Value]) -> Sequence[SweepPoint]:
        behind = [place for place in self.places if _may_be_behind(place, conditions)]
        return behind or self.places

    @property
    def seeds(self) -> frozenset[Value]:
        """Executed seeds of a random bench, if the test sweeps them."""
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
    """Compare the benches of a test's executed trials with the fingerprints that they state.

    Args:
        trials: executed trials; only measurements count.
        perturbs_bench: whether the experiment changes the bench on purpose. Then the initial bench
            counts: `described` with the swept values of the matrix.
        described: the test's bench before any sweep (SI); None if it is not archived.
        changed: reason why the test had more than one bench; "" when it had one.
        failed: numbers of the trials that did not complete.

    A sweep of the seed of the bench's scatter alters nothing if the bench's own seed is among the
    draws. Any other seed instead may have been selected by its result.
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
        scatters = isinstance(tree.get("variation"), Mapping)
        if described is not None and len(drawn) > 1 and own in drawn and scatters:
            tree = _replaced(tree, ["variation", "seed"], own)  # all its draws are one bench
        key = canonical_json([tree, compensation, trial.truth])
        if key not in known:
            why, described_at_all = _why(tree, compensation)
            known[key] = OF_A_TRUTH if trial.truth else why, described_at_all
        numbers = {name: v for name, v in trial.options.items() if isinstance(v, int | float)}
        lost = trial.number in failed
        place = SweepPoint(dict(trial.point), compensation, *known[key], numbers, lost)
        places.setdefault(canonical_json([place.point, compensation, *known[key], lost]), place)
    points = tuple(places.values())
    if perturbs_bench and described is None and any(not place.altered for place in points):
        # One of its trials is the unperturbed reference: the described bench.
        points = tuple(
            place if place.altered == OF_A_TRUTH else replace(place, altered="") for place in points
        )
    if changed:
        points = tuple(replace(place, altered=place.altered or changed) for place in points)
    return Provenance(points)


def _why(tree: Mapping[str, Any], compensation: str) -> tuple[str, bool]:
    """Reason why a bench is not the described one ("" if it is); whether it states its origin."""
    try:
        bench = Bench.model_validate(tree, context={"si": True})
    except ValueError:
        return "the bench it ran on cannot be read", False
    return why_altered(bench, compensation), bench.known.describes


def _at_point(tree: Mapping[str, Any], point: Mapping[str, Any]) -> Mapping[str, Any]:
    """The bench with the swept values of `point`."""
    for path, value in point.items():
        if path.startswith(BENCH):
            tree = _replaced(tree, path.removeprefix(BENCH).split("."), value)
    return tree


def _description(bench: Mapping[str, Any]) -> Any:
    """Stated origin of a bench, and the fingerprint of the bench that it applies to."""
    known = bench.get("known")
    if not isinstance(known, Mapping):
        return None
    return [known.get(name) for name in (*STATED, "fingerprint")]


def _own_seed(described: Tree | None) -> int:
    variation = (described or {}).get("variation")
    seed = variation.get("seed") if isinstance(variation, Mapping) else None
    return seed if isinstance(seed, int) else 0


def _replaced(tree: Mapping[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    below = tree.get(keys[0])
    inside = below if isinstance(below, Mapping) else {}
    return {**tree, keys[0]: value if len(keys) == 1 else _replaced(inside, keys[1:], value)}


def _may_be_behind(place: SweepPoint, conditions: Mapping[str, Value]) -> bool:
    same = conditions.get("compensation", place.compensation) == place.compensation
    return same and allow(conditions, place.point)
