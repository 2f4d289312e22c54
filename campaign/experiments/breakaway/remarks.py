"""Remarks on the numbers of a breakaway test, with what to do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.breakaway_torque import STILL_RISING
from campaign.estimation.presliding import NOT_RESOLVED, WINDOW
from campaign.experiments.breakaway.means import MEASURED, Ramps, option_of
from campaign.experiments.interface import bench_of
from campaign.units import angle_text, in_words, rate_text, torque_text

FEW_COUNTS = 10.0
"""Smallest number of encoder counts in presliding that shows a curve."""
SHORT_REST = 0.2
"""Rest over ramp length, below which the gyro's bias widens the interval of sigma0; at a third of
the ramp length it hardly does."""
LONG_REST = 0.3
"""Advised rest over ramp length, at least."""
WIDE = 0.05
"""Half-width over value, above which a longer rest is advised."""


def remarks(ramps: Ramps) -> Iterator[str]:
    """Sentences on the ramps; advice names the option to change."""
    for item, own in zip(ramps.trials, ramps.found, strict=True):
        if "bristle_stiffness" not in own:
            yield (
                f"{item.trial.label}: its presliding is too short or too noisy for a stiffness. A "
                "slower ramp has more samples; a faster one moves more above the noise."
            )
    yield "σ1 is assumed from a damping ratio; a torque ramp carries no information on it."
    if any(each.value > 1 for each in ramps.values("interfaces")):
        yield (
            "The presliding curve has two slopes: all interfaces stick at first, then the weaker "
            "one slips and only the stronger goes on deflecting."
        )
    yield from _inertia(ramps)
    yield from _encoder(ramps)
    yield from _rest(ramps)
    yield from _rate(ramps)
    yield from _hidden(ramps)
    yield from _unfinished(ramps)


def _inertia(ramps: Ramps) -> Iterator[str]:
    accelerations = [abs(each.value) for each in ramps.values("peak_acceleration")]
    inertia = bench_of(ramps.trials[0].trial).axis.inertia
    if accelerations and inertia is not None:
        moved = torque_text(0.01 * float(np.mean(accelerations)) * inertia, ".2g")
        yield f"An error of 1 % of the inertia moves the breakaway torque by {moved}."


def _encoder(ramps: Ramps) -> Iterator[str]:
    count = bench_of(ramps.trials[0].trial).sensors.encoder.resolution
    spans = [each.value for each in ramps.values("presliding_span")]
    if not spans or count == 0 or float(np.median(spans)) >= FEW_COUNTS * count:
        return
    yield (
        f"Presliding spans {float(np.median(spans)) / count:.2g} counts of the encoder: σ0 rests "
        "on the gyro alone. An angle sensor that is to show presliding needs counts of "
        f"{angle_text(float(np.median(spans)) / FEW_COUNTS, '.2g')} or finer."
    )


def _rest(ramps: Ramps) -> Iterator[str]:
    stiffness = ramps.values("bristle_stiffness")
    rest, rate = option_of(ramps, "rest"), option_of(ramps, "torque_rate")
    torques = [each.value for each in ramps.values("breakaway_torque")]
    wide = [each for each in stiffness if _relative(each) > WIDE]
    if not torques or not wide:
        return
    length = float(np.mean(torques)) / rate
    if rest < SHORT_REST * length:
        yield (
            f"A rest of {rest:.3g} s determines the gyro's bias poorly, which widens the interval "
            f"of σ0: rest {LONG_REST * length:.2g} s or longer."
        )


def _rate(ramps: Ramps) -> Iterator[str]:
    refused = [
        name
        for name in MEASURED
        if any(each.reason and each.standard_error is not None for each in ramps.values(name))
        and not any(each.is_bound for each in ramps.values(name))
    ]
    stiffness = ramps.values("bristle_stiffness")
    shifted = sum(_by_window(each) > 0.5 * _scatter(each) > 0 for each in stiffness)
    gyro = bench_of(ramps.trials[0].trial).sensors.gyro
    noisy = gyro.noise > 0 or gyro.resolution > 0
    if noisy and (refused or 2 * shifted > len(stiffness)):
        rate = 0.25 * option_of(ramps, "torque_rate")
        yield (
            "The ramp is too fast for the curve of bristles, or its sensors too coarse: sweep "
            f"torque_rate, or choose {in_words(rate, 'N m/s', form='.2g')}."
        )


def _hidden(ramps: Ramps) -> Iterator[str]:
    fitted = [own for own in ramps.found if "stiffness_at_rest" in own]
    bounds = sum(own["stiffness_at_rest"].reason in NOT_RESOLVED for own in fitted)
    above = sum(own["bristle_stiffness"].reason in NOT_RESOLVED for own in fitted)
    if not (bounds or above):
        return
    rate = option_of(ramps, "torque_rate")
    yield (
        f"The gyro's noise may hide a stiffer interface that slips first. Of {len(fitted)} ramps, "
        f"stiffness at rest is a lower bound in {bounds} and σ0 an upper bound in {above}. A "
        f"torque_rate of {in_words(4.0 * rate, 'N m/s', form='.2g')} shows twice as much above "
        "the noise."
    )


def _unfinished(ramps: Ramps) -> Iterator[str]:
    bounds = [each for each in ramps.values("breakaway_torque") if each.kind == "at least"]
    if bounds:
        rate = option_of(ramps, "sliding_rate")
        risen = all(each.reason in STILL_RISING for each in bounds)
        why = "was still rising" if risen else "did not fall significantly before"
        yield (
            f"Friction {why} {'when ' if risen else ''}ramps ended: their breakaway torque is a "
            f"bound. Choose a sliding_rate of {rate_text(4.0 * rate, '.2g')} or more."
        )


def _relative(estimate: Estimate) -> float:
    return estimate.half_width / abs(estimate.value) if estimate.value else 0.0


def _by_window(estimate: Estimate) -> float:
    """Systematic part of the end of the fitted window (1 sigma)."""
    parts = (part for part in estimate.systematic if part.source == WINDOW)
    return sum(part.standard_uncertainty or 0.0 for part in parts)


def _scatter(estimate: Estimate) -> float:
    """Half-width of the interval without systematic parts; 0 without an interval."""
    if estimate.low is None or estimate.high is None:
        return 0.0
    return 0.5 * (estimate.high - estimate.low)
