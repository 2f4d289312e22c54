"""Friction, or its coefficient, over rate: points and curves of each direction.

For runs of a map and for stretches of any recording. A ripple over position is removed first. Many
speeds give a Stribeck curve, fewer a straight line, one speed the friction at it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from campaign.channels import DRIVE_TORQUE
from campaign.estimate import Estimate
from campaign.estimation.both_directions import fitted_nominal
from campaign.estimation.friction_line import (
    FrictionLine,
    friction_line,
    in_order_of_time,
    mean_of_stretches,
)
from campaign.estimation.intervals import multiplied, shifted_by
from campaign.estimation.ripple import Ripple, ripple_of_points, window_noise
from campaign.estimation.sampled_curve import drop_interval_if_deterministic
from campaign.estimation.stribeck import PARAMETERS, fit_stribeck, stribeck
from campaign.estimation.velocity_map import (
    DirectionFit,
    Model,
    band,
    direction_estimates,
    fit_direction,
    passed,
    shifts,
)
from campaign.experiments.friction_map.points import Point, coefficient_of, with_constants
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.interface import TrialData, bench_of
from campaign.result import Array
from campaign.units import rate_text

ANGLE = "angle"
"""Systematic part: torque removed by its dependence on the angle."""
DIGITS = 6
"""Digits to which points may lie on a curve; closer points are computed, not measured."""
ONE_SPEED = 0.02
"""Largest relative difference of speeds that count as one: a loop does not reach them exactly."""
FEWEST_SPEEDS = 7
"""Fewest speeds of stretches of a direction for a Stribeck curve ..."""
FEWEST_RUNS = 6
"""... and of runs, whose windows are long and settled."""
MEANINGS = {
    "coulomb_torque": ("N m", "Dry friction of fast sliding"),
    "static_torque": ("N m", "Friction at the onset of sliding"),
    "stribeck_velocity": ("rad/s", "Rate over which friction goes from static to Coulomb"),
    "stribeck_exponent": ("", "Shape of that"),
    "viscous_friction": ("N m s/rad", "Friction that grows with the rate"),
    "friction": ("N m", "Friction of sliding, at the speeds that there are"),
}


@dataclass(frozen=True)
class Quantity:
    """Friction, or friction over normal load.

    Attributes:
        name: in the names of parameters: `coulomb_torque`, `coulomb_coefficient`.
        per_torque: factor on the torque of a point.
        meanings: unit and meaning of each parameter, by its name.
        axis: of its figure: label, SI unit, display unit.
    """

    name: str
    per_torque: Callable[[Point], float]
    meanings: Mapping[str, tuple[str, str]]
    axis: tuple[str, str, str]

    def called(self, parameter: str) -> str:
        """Name of a parameter of this quantity."""
        if self.name == "torque":
            return parameter
        called = {"viscous_friction": f"viscous_{self.name}", "friction": f"friction_{self.name}"}
        return called.get(parameter, parameter.replace("torque", self.name))


FRICTION = Quantity("torque", lambda _: 1.0, MEANINGS, ("Friction torque", "N m", "N m"))
COEFFICIENT = Quantity(
    "coefficient",
    lambda point: 1.0 / point.load,
    {
        **MEANINGS,
        "coulomb_torque": ("", "Friction coefficient of fast sliding"),
        "static_torque": ("", "Friction coefficient at the onset of sliding"),
        "viscous_friction": ("s/rad", "How the friction coefficient grows with the rate"),
        "friction": ("", "Friction coefficient"),
    },
    ("Friction coefficient", "", ""),
)


@dataclass(frozen=True)
class Curves:
    """Points of one quantity over rate, and their fits by direction.

    Attributes:
        points: both directions; `ripple` is set where one was removed.
        first: a trial, which states the uncertainty of torque and load.
        force: channel of the torque.
        ripples: None without a common ripple of the points.
        fits, lines: Stribeck curves, or straight lines.
        others: parameters of a line or a mean, by name, with intervals by scatter.
        shift: J times the residual acceleration at each value of a fit, shape (n,).
        moved: the same for each parameter of `others`.
        doubts: uncertainty by the torque removed by angle (1 sigma), by direction and parameter.
        notes: sentences on the fits, and on missing ones.
    """

    quantity: Quantity
    points: tuple[Point, ...]
    first: TrialData
    force: str = DRIVE_TORQUE
    ripples: dict[str, Ripple | None] = field(default_factory=dict)
    fits: dict[str, DirectionFit] = field(default_factory=dict)
    lines: dict[str, FrictionLine] = field(default_factory=dict)
    others: dict[str, dict[str, Estimate]] = field(default_factory=dict)
    shift: dict[str, Array] = field(default_factory=dict)
    moved: dict[str, dict[str, float]] = field(default_factory=dict)
    doubts: dict[tuple[str, str], float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _told: dict[Model, dict[str, dict[str, Estimate]]] = field(default_factory=dict, repr=False)

    @property
    def is_map(self) -> bool:
        """Whether both directions have a Stribeck curve."""
        return self.fits.keys() == DIRECTIONS.keys()

    @property
    def found(self) -> dict[str, dict[str, Estimate]]:
        """Parameters by direction, then by name, systematic parts included."""
        told = {way: self._fitted(way, fit.accepted) for way, fit in self.fits.items()}
        for way, by_name in self.others.items():
            effects = self.moved[way]
            told[way] = {name: self._shared(one, way, effects) for name, one in by_name.items()}
        return {way: told[way] for way in DIRECTIONS if way in told}

    def estimates(self, model: Model) -> dict[str, dict[str, Estimate]]:
        """Parameters of a map by direction, `nominal` last; then by name. With systematic parts.

        Those of the nominal are the mean of both directions: one constant shifts both.
        """
        if model not in self._told:
            effects = [shifts(self.fits[way].fits[model], self.shift[way]) for way in DIRECTIONS]
            mean = {name: 0.5 * sum(each.get(name, 0.0) for each in effects) for name in PARAMETERS}
            both = self.fits["positive"], self.fits["negative"]
            told = {way: self._fitted(way, model) for way in DIRECTIONS}
            told["nominal"] = {
                name: passed(self._shared(one, "nominal", mean), model, *both)
                for name, one in fitted_nominal(*both, model).items()
            }
            self._told[model] = told
        return self._told[model]

    def _fitted(self, way: str, model: Model) -> dict[str, Estimate]:
        fit = self.fits[way]
        effects = shifts(fit.fits[model], self.shift[way])
        return direction_estimates(fit, model, lambda one: self._shared(one, way, effects))

    def _shared(self, one: Estimate, way: str, effects: Mapping[str, float]) -> Estimate:
        """Add the systematic parts of the torque removed by angle, and of constants."""
        one = drop_interval_if_deterministic(one, abs(one.value), DIGITS)
        if not one.has_interval and one.name != "friction":
            return one
        doubt = self.doubts.get((way, one.name), 0.0)
        one = shifted_by(one, ANGLE, doubt) if doubt > 0 else one
        return self.with_constants(one, effects.get(one.name, 0.0))

    def with_constants(self, one: Estimate, moved: float = 0.0) -> Estimate:
        """A number of several points, with the parts of constants, which no point shows."""
        loaded, scales = self.quantity is COEFFICIENT, not one.name.startswith("stribeck")
        return with_constants(one, self.first, self.force, moved, scales=scales, loaded=loaded)

    def read(self, point: Point) -> Estimate:
        """The quantity at a point, signed, with the interval of its window alone."""
        if self.quantity is FRICTION:
            return point.torque
        return multiplied(coefficient_of(point, self.first), point.sign)

    def curve(self, way: str, speed: Array, model: Model | None = None) -> list[Array]:
        """Fit at `speed`, shape (n,), and both ends of its 95 % band; empty for a mean.

        Positive against the motion. model: the accepted one if None.
        """
        if way in self.fits:
            fit = self.fits[way]
            model = model or fit.accepted
            middle = np.asarray(stribeck(speed, fit.fits[model].values))
            half = band(fit, model, speed)
            return [middle, middle - half, middle + half]
        if way in self.lines:
            line = self.lines[way]
            return [line.coulomb.value + line.viscous.value * speed, *line.band(speed)]
        return []


def fit_curves(
    points: Sequence[Point],
    first: TrialData,
    quantity: Quantity = FRICTION,
    force: str = DRIVE_TORQUE,
) -> Curves:
    """Stribeck curves, lines or means of each direction.

    Args:
        points: in order of time.
        first: one of their trials.
        force: channel of their torque.
    """
    curves, kept = Curves(quantity, (), first, force), []
    for name, sign in DIRECTIONS.items():
        own = [p for p in points if p.sign == sign and p.rate.value * sign > 0]
        own, curves.ripples[name] = without_ripple(own)
        kept += own
        if own:
            _fit(curves, name, list(_over_starts(own, quantity)))
        else:
            curves.notes.append(f"The axis never slides steadily in the {name} direction.")
    for part in range(min((len(each.doubts) for each in kept), default=0)):
        other = fit_curves([each.off_by(part) for each in kept], first, quantity, force).found
        for way, estimates in curves.found.items():
            for name, one in estimates.items():
                again = other.get(way, {}).get(name)
                moved = 0.0 if again is None else again.value - one.value
                doubt = curves.doubts.get((way, name), 0.0)
                curves.doubts[way, name] = float(np.hypot(doubt, moved))
    return replace(curves, points=tuple(kept))


def fit_map(points: Sequence[Point], first: TrialData) -> Curves:
    """Stribeck curves of both directions. Raises ValueError if one has too few speeds."""
    curves = fit_curves(points, first)
    if not curves.is_map:
        raise ValueError("; ".join(note.rstrip(".") for note in curves.notes))
    return curves


def _fit(curves: Curves, name: str, own: Sequence[_Averaged]) -> None:
    """Fit the points of one direction, and add the result and its notes to `curves`."""
    sign, quantity, notes = DIRECTIONS[name], curves.quantity, curves.notes
    speed = np.array([abs(each.rate) for each in own])
    values = sign * np.array([each.value for each in own])
    error = np.array([each.error for each in own])
    # Without an inertia the part is unknown for any number here: `with_systematic`.
    inertia = bench_of(curves.first.trial).axis.inertia or 0.0
    moved = sign * inertia * np.array([each.acceleration for each in own])
    commanded = [abs(each.commanded) for each in own if each.commanded is not None]
    place = np.array(commanded) if len(commanded) == len(own) else places(speed)
    distinct = np.unique(place)
    fewest = FEWEST_RUNS if commanded else FEWEST_SPEEDS
    why = f"{fewest} are the fewest"
    if len(distinct) >= fewest:
        try:
            fit = fit_direction(speed, values, error, place)
        except ValueError as problem:  # a bench without friction has no curve
            why = str(problem)
        else:
            curves.fits[name] = fit
            curves.shift[name] = np.array([float(np.mean(moved[place == at])) for at in distinct])
            notes.append(f"In the {name} direction {_stribeck_part(fit)}.")
            return
    try:
        line = friction_line(speed, values)
    except ValueError as problem:
        mean = mean_of_stretches("friction", values, quantity.meanings["friction"][0])
        curves.others[name] = {"friction": mean}
        curves.moved[name] = {"friction": float(np.mean(moved))}
        at = f"{rate_text(float(speed.min()))} to {rate_text(float(speed.max()))}"
        notes.append(
            f"In the {name} direction {problem}: friction is that from {at}, and what of it is "
            "dry or viscous is not known."
        )
        return
    curves.lines[name] = line
    curves.others[name] = {one.name: one for one in (line.coulomb, line.viscous)}
    slope, dry = np.polyfit(speed, moved, 1)
    curves.moved[name] = {"coulomb_torque": float(dry), "viscous_friction": float(slope)}
    notes.append(
        f"In the {name} direction {len(distinct)} speeds show a straight line and no "
        f"Stribeck curve; {why}."
    )
    if in_order_of_time(speed):
        notes.append(
            f"In the {name} direction speeds go one way as time goes on: friction that changes "
            "with time, as it warms up, looks like viscous friction."
        )


def _stribeck_part(fit: DirectionFit) -> str:
    """Whether friction falls or rises at the onset of sliding, in words."""
    # An accepted line shows no Stribeck part, for any free curve.
    if not fit.shows_stribeck_effect or fit.accepted == "none":
        return (
            "static friction is not distinguishable from Coulomb friction: there is no Stribeck "
            "part that these speeds could identify"
        )
    values = fit.fits[fit.accepted].values
    if values["static_torque"] < values["coulomb_torque"]:
        return "static friction lies below Coulomb friction: friction rises as sliding sets in"
    return "static friction lies above Coulomb friction, as of a Stribeck curve"


def places(speed: Array) -> Array:
    """Number of the place of each speed, shape (n,): one place is within 2 % of its slowest."""
    place, first, number = np.empty(len(speed)), math.nan, -1
    for index in np.argsort(speed):
        if not speed[index] <= first * (1.0 + ONE_SPEED):
            first, number = float(speed[index]), number + 1
        place[index] = number
    return place


def dry_torques(points: Sequence[Point]) -> Array:
    """Signed friction torque of each point without its viscous part (N m), by a first fit; (n,)."""
    rate = np.array([point.rate.value for point in points])
    torque = np.array([point.torque.value for point in points])
    viscous = fit_stribeck(np.abs(rate), np.abs(torque)).values["viscous_friction"]
    return np.asarray(torque - viscous * rate)


def without_ripple(points: Sequence[Point]) -> tuple[list[Point], Ripple | None]:
    """Points of one direction, each with its part of their common ripple, and that ripple."""
    if len(points) <= len(PARAMETERS) or not any(point.harmonic for point in points):
        return list(points), None
    first, last = (np.array([getattr(p, end) for p in points]) for end in ("first", "last"))
    harmonics = [point.harmonic for point in points]
    dry = dry_torques(points)
    taken, error, ripple = ripple_of_points(harmonics, dry, first, last)
    if ripple is None:
        return list(points), None
    noise = window_noise(np.array([point.error for point in points]), ripple, first, last, dry)
    return [
        replace(point, ripple=float(t), error=float(np.hypot(n, e)))
        for point, t, n, e in zip(points, taken, noise, error, strict=True)
    ], ripple


@dataclass(frozen=True)
class _Averaged:
    """Mean of the points of one speed and repetition over all start angles; of one stretch.

    acceleration: times the inertia, its contribution to the value.
    """

    commanded: float | None
    rate: float
    value: float
    error: float
    acceleration: float


def _over_starts(points: Sequence[Point], quantity: Quantity) -> Iterator[_Averaged]:
    groups: dict[tuple[float, int], list[Point]] = {}
    for number, point in enumerate(points):
        is_stretch = point.commanded is None
        key = (number, -1) if is_stretch else (point.speed, point.repeat)
        groups.setdefault(key, []).append(point)
    for group in groups.values():
        by = [quantity.per_torque(p) for p in group]
        each = list(zip(group, by, strict=True))
        yield _Averaged(
            group[0].commanded,
            float(np.mean([p.rate.value for p in group])),
            float(np.mean([k * (p.torque.value - p.ripple) for p, k in each])),
            float(np.sqrt(np.mean([(k * p.error) ** 2 for p, k in each]) / len(group))),
            float(np.mean([k * p.acceleration for p, k in each])),
        )
