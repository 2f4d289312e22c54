"""From the points of a velocity map to fits of both directions, its ripple taken out first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from campaign.channels import DRIVE_TORQUE
from campaign.estimate import Estimate
from campaign.estimation.both_directions import fitted_nominal
from campaign.estimation.ripple import Ripple, ripple_of_points, window_noise
from campaign.estimation.sampled import drop_interval_if_deterministic
from campaign.estimation.stribeck import PARAMETERS, fit_stribeck
from campaign.estimation.velocity_map import (
    DirectionFit,
    Model,
    fit_direction,
    fitted_estimates,
    passed,
    shifts,
)
from campaign.experiments.friction_map.points import MapPoint
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.imported_scale import with_scale
from campaign.experiments.shared.systematic import INERTIA, TORQUE_CONSTANT, with_systematic
from campaign.physics.bench import Bench
from campaign.result import Array

DIGITS = 6
"""to which points may lie on a curve before nobody believes that they were measured."""
TORQUES = ("viscous_friction", "coulomb_torque", "static_torque")
"""Parameters that are proportional to the torque constant."""


@dataclass(frozen=True)
class MapFits:
    """A whole map: its points, the ripple that was taken out of them, the fits by direction.

    Attributes:
        points: in the order of their speeds; `ripple` is set where one was taken out.
        ripples: by direction; None where the runs share none.
        shift: what the residual acceleration contributes to each torque of a fit (N m), as a share
            of J; by direction, shape (n,).
    """

    points: tuple[MapPoint, ...]
    ripples: Mapping[str, Ripple | None]
    fits: Mapping[str, DirectionFit]
    shift: Mapping[str, Array]
    bench: Bench
    first: TrialData | None = None
    _told: dict[Model, dict[str, dict[str, Estimate]]] = field(default_factory=dict, repr=False)

    def estimates(self, model: Model) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction, `nominal` behind both; then by name. Systematic parts included.

        Those of the nominal are the mean of both directions: one constant moves both.
        """
        if model not in self._told:
            self._told[model] = self._estimates(model)
        return self._told[model]

    def _estimates(self, model: Model) -> dict[str, dict[str, Estimate]]:
        effects = {name: self._effects(name, model) for name in DIRECTIONS}
        effects["nominal"] = {
            parameter: 0.5 * sum(effects[name].get(parameter, 0.0) for name in DIRECTIONS)
            for parameter in PARAMETERS
        }
        found = {name: fitted_estimates(self.fits[name], model) for name in DIRECTIONS}
        both = self.fits["positive"], self.fits["negative"]
        found["nominal"] = fitted_nominal(*both, model)
        of = {name: (self.fits[name],) for name in DIRECTIONS} | {"nominal": both}
        return {
            name: {
                each.name: passed(self._shifted(each, effects[name]), model, *of[name])
                for each in estimates.values()
            }
            for name, estimates in found.items()
        }

    def _effects(self, direction: str, model: Model) -> dict[str, float]:
        return shifts(self.fits[direction].fits[model], self.shift[direction])

    def _shifted(self, told: Estimate, effects: Mapping[str, float]) -> Estimate:
        told = drop_interval_if_deterministic(told, abs(told.value), DIGITS)
        if not told.has_interval:
            return told
        if told.name in TORQUES:
            told = with_systematic(told, self.bench, TORQUE_CONSTANT, told.value)
            if self.first is not None:
                told = with_scale(told, self.first, DRIVE_TORQUE)
        return with_systematic(told, self.bench, INERTIA, effects.get(told.name, 0.0))


def fit_map(points: Iterable[MapPoint], bench: Bench, first: TrialData | None = None) -> MapFits:
    """Both directions of a map, its ripple taken out first.

    `first`: one of its trials, which says how well an imported torque is known.

    Raises ValueError for a direction with too few speeds.
    """
    ripples: dict[str, Ripple | None] = {}
    fits: dict[str, DirectionFit] = {}
    shift: dict[str, Array] = {}
    kept: list[MapPoint] = []
    everything = sorted(points, key=lambda point: (abs(point.speed), point.repeat))
    for name, sign in DIRECTIONS.items():
        own = [p for p in everything if p.rate.value * sign > 0 and p.sign == sign]
        own, ripples[name] = without_ripple(own)
        kept += own
        averaged = list(_over_starts(own))
        fits[name] = fit_direction(
            np.array([abs(p.rate) for p in averaged]),
            np.array([p.torque * sign for p in averaged]),
            np.array([p.error for p in averaged]),
            np.array([abs(p.speed) for p in averaged]),
        )
        by_speed = {p.speed: p for p in averaged}
        moved = [sign * by_speed[speed].acceleration for speed in sorted(by_speed, key=abs)]
        # Without an inertia the part is unknown, whatever stands here: `with_systematic`.
        shift[name] = (bench.axis.inertia or 0.0) * np.array(moved)
    return MapFits(tuple(sorted(kept, key=lambda p: p.speed)), ripples, fits, shift, bench, first)


def dry_torques(points: Sequence[MapPoint]) -> Array:
    """Signed friction torque of each point without its viscous part (N m), by a first fit; (n,)."""
    rate = np.array([point.rate.value for point in points])
    torque = np.array([point.torque.value for point in points])
    viscous = fit_stribeck(np.abs(rate), np.abs(torque)).values["viscous_friction"]
    return np.asarray(torque - viscous * rate)


def without_ripple(points: Sequence[MapPoint]) -> tuple[list[MapPoint], Ripple | None]:
    """The points of one direction, told how much of each torque is ripple, and that ripple."""
    told = list(points)
    if len(told) <= len(PARAMETERS):
        return told, None
    first, last = (np.array([getattr(p, end) for p in told]) for end in ("first", "last"))
    harmonics = [point.harmonic for point in told]
    dry = dry_torques(told)
    taken, error, ripple = ripple_of_points(harmonics, dry, first, last)
    if ripple is None:
        return told, None
    noise = window_noise(np.array([point.error for point in told]), ripple, first, last, dry)
    return [
        replace(point, ripple=float(t), error=float(np.hypot(n, e)))
        for point, t, n, e in zip(told, taken, noise, error, strict=True)
    ], ripple


@dataclass(frozen=True)
class _Averaged:
    """Points of one speed and repetition, from all angles that it began at."""

    speed: float
    rate: float
    torque: float
    error: float
    acceleration: float


def _over_starts(points: Sequence[MapPoint]) -> Iterator[_Averaged]:
    groups: dict[tuple[float, int], list[MapPoint]] = {}
    for point in points:
        groups.setdefault((point.speed, point.repeat), []).append(point)
    for (speed, _), group in groups.items():
        yield _Averaged(
            speed,
            float(np.mean([p.rate.value for p in group])),
            float(np.mean([p.torque.value - p.ripple for p in group])),
            float(np.sqrt(np.mean([p.error**2 for p in group]) / len(group))),
            float(np.mean([p.acceleration for p in group])),
        )
