"""The integration step of a trial from its bench and task.

The linear part is exact at any step (`campaign.physics.loop.discretise`). A step must resolve
friction with bristles, and the motion that it excites. At the load, with sums over the interfaces
with bristles, and J without the appendage:

    tau_c = J / sum of sigma1        damping of the bristles. The engine predicts the rate at the
                                     end of a step with constant torques, which is stable only
                                     while h sum(sigma1) / J is well below 1.
    tau_k = sqrt(J / sum of sigma0)  the load on its bristles, as on a spring.
    tau_r = sqrt(z / a)              time in which a reversal bends the bristles over. z is
                                     sum of s / sum of sigma0, s the least torque of steady sliding;
                                     a the amplitude of the base's acceleration plus that of a rate
                                     command. With a friction model as compensation behind a
                                     low-pass of time T, an initial hull rate v0 adds v0 / T to a.
    tau_p = 1 / max |p|              the fastest pole p of the continuous part, stuck on bristles:
                                     the loop with controller and compensation, or only the load.
    tau_l                            the same for the load alone on its bristles.
    tau_o                            ringing over the whole trial, see `_ringing`.

The error after one reversal is of second order in h / tau_r (bending of the bristles) and in
h / tau_p (response of the loop). The limit uses their geometric mean. It has no derivation, but
fits the benches below better than either. Each limit is a constant times a time; the least decides:

    DAMPING tau_c                 always
    REVERSAL sqrt(tau_p tau_r)    if base or command reverse the rate
    HELD tau_l                    if the hull moves at the start of the trial, and later excites
                                  the load with less than a tenth of its friction: the initial
                                  transient is then the largest motion
    RESTING tau_k                 with a commanded torque, or a spring
    RINGING tau_o                 always
    JUMPS tau_p                   if the friction or its compensation jumps, and the loop responds
    FED tau_p                     if both jump: the difference of two jumps remains
    DRY                           if friction is dry
    OWN times `fastest`           for each model that states its own time

JUMPS, FED and DRY apply to dry friction, with or without bristles: its compensation passes its
jumps to the fast poles, and a step represents them by mean and first moment only. Against the
event-switched reference (benchmarks/dry_friction.py) the largest error of a channel of the thesis'
loop is 2.7e-4; at 1 ms it was 1.5e-3, and 2.7e-3 behind the observer. Against the engine itself at
1/128 ms no channel is off by 1e-3 (nine curves in modes rate and torque, five static compensations,
exact and not, 1 to 2 s each). Exceptions: a friction torque that jumps once in a second, which a
single sample may show on the wrong side (2.9e-3); curves with infinite slope at rest, 4.6e-3 with a
Stribeck exponent of 0.2.

Evidence for the others: random benches (tests/physics/random_benches.py) with continuous control,
in modes rate and torque, against scipy's LSODA at 1e-10. The error is the largest of all channels
over 5 s, relative to the RMS of its channel. Form and constants were tuned on 235 ordinary and 114
extreme benches, and validated on 140 ordinary and 60 extreme others. Of these, one extreme bench is
refused. One has an inconsistent reference (its rate and the compensation by that rate, 1e-4 of the
friction torque). The largest error of the rest is 4.0e-4. `make soak` runs 200 others: two extreme
ones are refused, none is off by 1e-3. Most steps are 4 times shorter than needed. Sampled
controllers and springs have no such reference: for them the rule is an extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from campaign.arrays import ComplexArray
from campaign.physics.base_motion import base_rate
from campaign.physics.compensation.interface import Compensator
from campaign.physics.complete import CompleteBench
from campaign.physics.friction import is_dry, jumps, model_of, small_signal_of
from campaign.physics.friction.interface import FrictionOptions, Presliding
from campaign.physics.loop import make_compensator, make_loop
from campaign.physics.rows import COMPENSATION, FRICTION, RATE, RELATIVE_ANGLE
from campaign.signals import MultiSine, Polyline, Signal, Sine
from campaign.trial import Task

LONGEST = 1e-3
"""s."""
HALVINGS = 10
"""Steps are LONGEST / 2^k, k = 0 .. HALVINGS."""
DAMPING, REVERSAL, HELD, RESTING, RINGING = 0.2, 0.05, 0.03, 0.05, 0.2
JUMPS, FED, OWN = 1.5, 0.09, 0.25
DRY = LONGEST / 4.0
"""s."""
BARELY_SHAKEN = 0.1
"""Share of friction: HELD applies if J times the base's acceleration is below it."""
AT_REST = 1e-9
"""rad/s; rounding error of the initial rate of a sine that begins at its crest."""
STANDING = 1.0
"""1/s; slower poles are integrators and do not ring."""
SPEEDS = np.concatenate([side * np.logspace(-7.0, 2.0, 91) for side in (-1.0, 1.0)])
"""rad/s at the interface; grid of the search for the least torque of steady sliding."""


@dataclass(frozen=True)
class StepChoice:
    """The step of a trial.

    Attributes:
        step: s, LONGEST / 2^k; the finest step if the trial is refused.
        needed: s, the value before rounding down; LONGEST without a shorter limit.
        because: text of the rule that decided.
        refused: text of the rule that needs a step below the finest; else None.
    """

    step: float
    needed: float
    because: str
    refused: str | None = None


@dataclass(frozen=True)
class _Limit:
    """Longest step (s) that a rule allows."""

    step: float
    because: str


@dataclass(frozen=True)
class _Contact:
    """An interface with bristles, at the load.

    Attributes:
        place: path in the bench.
        stiffness, damping: N m/rad, N m s/rad.
        torque: least torque of steady sliding (N m).
    """

    place: str
    stiffness: float
    damping: float
    torque: float


def longest_step(bench: CompleteBench, task: Task) -> StepChoice:
    """Longest step LONGEST / 2^k that satisfies all rules for a trial.

    bench: with the friction of the trial, from `variation.as_it_is`. Dry friction models, and those
    without a declared small-signal response, count as models without bristles.
    """
    limits = [] if task.mode == "prescribed" else list(_limits(bench, task))
    least = min(limits, key=lambda limit: limit.step, default=_Limit(LONGEST, ""))
    if least.step >= LONGEST * (1.0 - 1e-9):
        return StepChoice(LONGEST, LONGEST, "nothing in this trial needs a shorter one")
    halvings = math.ceil(math.log2(LONGEST / least.step) - 1e-9)
    if halvings <= HALVINGS:
        return StepChoice(LONGEST / 2**halvings, least.step, least.because)
    finest = LONGEST / 2**HALVINGS
    refused = (
        f"{least.because} needs steps of {least.step * 1e6:.2g} us; the finest there are "
        f"have {finest * 1e6:.2g} us"
    )
    return StepChoice(finest, least.step, least.because, refused)


def _limits(bench: CompleteBench, task: Task) -> Iterator[_Limit]:
    continuous = bench.controller.sample_rate is None and task.mode in ("rate", "torque")
    compensator = make_compensator(bench, task.compensation) if continuous else Compensator()
    models = [(f"compensation.{task.compensation}", each) for each, _ in compensator.friction]
    plant = [(f"friction.{name}", each) for name, each in bench.friction.items()]
    own = _contacts(plant, bench)
    compensating = _contacts(models, bench)
    contacts = own or compensating
    dry = [name for name, each in bench.friction.items() if is_dry(each)]
    if dry:
        yield _Limit(DRY, f"dry friction.{dry[0]}")
    fed = any(jumps(each) for each, _ in compensator.friction)
    answers = compensator.linear is not None or len(compensator.friction) > 0
    if fed or (answers and dry):
        fastest = _fastest(stuck_poles(bench, task, compensator))
        share = FED if fed and dry else JUMPS
        yield _Limit(share / fastest, f"jumps of dry friction at compensation.{task.compensation}")
    yield from _own_times(plant + models)
    if not contacts:
        return
    inertia = bench.axis.inertia - (bench.appendage.inertia if bench.appendage else 0.0)
    stiffness = sum(contact.stiffness for contact in contacts)
    damping = sum(contact.damping for contact in contacts)
    torque = sum(contact.torque for contact in contacts)
    stiffest = max(contacts, key=lambda contact: contact.stiffness).place
    if damping > 0.0:
        dampest = max(contacts, key=lambda contact: contact.damping).place
        yield _Limit(DAMPING * inertia / damping, f"bristle damping of {dampest}")

    alone = _load_poles(inertia, damping, stiffness + task.spring_stiffness)
    poles = stuck_poles(bench, task, compensator) if continuous else alone
    base = _amplitude(task.base_acceleration)
    start = abs(float(base_rate(task.base_acceleration, np.zeros(1))[0]))
    reversing = base + (_steepest(task.command) if task.mode == "rate" else 0.0)
    if compensating and bench.controller.relative_rate_filter > 0.0:
        reversing += start / bench.controller.relative_rate_filter
    if reversing > 0.0:
        bending = math.sqrt(torque / stiffness / reversing)
        yield _Limit(
            REVERSAL * math.sqrt(bending / _fastest(poles)),
            f"reversals on the bristles of {stiffest}",
        )
    if start > AT_REST and inertia * base < BARELY_SHAKEN * torque:
        yield _Limit(
            HELD / _fastest(alone), f"the start of a load that the bristles of {stiffest} hold"
        )
    if task.mode in ("torque", "spring"):
        resting = math.sqrt(inertia / stiffness)
        yield _Limit(RESTING * resting, f"bristle stiffness of {stiffest}")
    ringing = _ringing(poles, task.duration)
    yield _Limit(RINGING * ringing, f"ringing on the bristles of {stiffest}")


def _own_times(friction: list[tuple[str, FrictionOptions]]) -> Iterator[_Limit]:
    for place, options in friction:
        model = model_of(options)
        if model.fastest is not None and (fastest := model.fastest(options)) > 0.0:
            yield _Limit(OWN * fastest, f"the fastest time of {place}")


def _contacts(friction: list[tuple[str, FrictionOptions]], bench: CompleteBench) -> list[_Contact]:
    contacts = []
    for place, options in friction:
        bristles = _bristles(options)
        if bristles is not None:
            torque, rate = bench.at_load(options)
            sliding = model_of(options).steady_state(options, SPEEDS)
            contacts.append(
                _Contact(
                    place,
                    torque * rate * bristles.stiffness,
                    torque * rate * bristles.damping,
                    torque * float(np.min(np.abs(sliding))),
                )
            )
    return contacts


def _bristles(options: FrictionOptions) -> Presliding | None:
    """Spring and damper of an interface at rest; None without bristles."""
    stuck = small_signal_of(options).stuck
    return stuck if stuck is not None and stuck.stiffness > 0.0 else None


def stuck_poles(bench: CompleteBench, task: Task, compensator: Compensator) -> ComplexArray:
    """Poles (1/s) of the loop at rest, plant and compensation stuck on their bristles."""
    loop = make_loop(bench, "rate" if task.mode == "rate" else "torque", compensator)
    a, low_pass = loop.a.copy(), bench.controller.relative_rate_filter
    for options in bench.friction.values():
        if (bristles := _bristles(options)) is not None:
            at = math.prod(bench.at_load(options))
            a[:, RELATIVE_ANGLE] += loop.b[:, FRICTION] * at * bristles.stiffness
            a[:, RATE] += loop.b[:, FRICTION] * at * bristles.damping
    for options, gain in compensator.friction:
        stuck = small_signal_of(options).stuck_compensation
        if stuck is not None:
            added = loop.b[:, COMPENSATION] * gain * math.prod(bench.at_load(options))
            # Behind the low-pass, the bristles move by the angle minus the lag of the filter.
            a[:, RELATIVE_ANGLE] += added * stuck.stiffness
            a[:, loop.seen] += added * (stuck.damping - low_pass * stuck.stiffness)
    return np.linalg.eigvals(a).astype(complex)


def _load_poles(inertia: float, damping: float, stiffness: float) -> ComplexArray:
    """Poles (1/s) of the load on its bristles and on the spring of mode `spring`."""
    # As in `np.roots`, without its search for zero coefficients.
    return np.linalg.eigvals([[-damping / inertia, -stiffness / inertia], [1.0, 0.0]]).astype(
        complex
    )


def _fastest(poles: ComplexArray) -> float:
    """Largest magnitude of a pole (1/s)."""
    return float(np.max(np.abs(poles)))


def _ringing(poles: ComplexArray, duration: float) -> float:
    """tau_o (s): 1 / tau_o^2 is the largest |p|^3 t sqrt(t / T) of an oscillating pole p.

    In a step h the phase of a mode has a relative error of (h |p|)^2. It accumulates over the
    duration of the mode, t = 1 / (2 max(-Re p, 1 / T)). The error is present for t of the trial's
    T, which contributes sqrt(t / T) to an RMS.
    """
    modes = poles[np.abs(poles) > STANDING]
    if not len(modes):
        return math.inf
    lasting = 1.0 / (2.0 * np.maximum(-modes.real, 1.0 / duration))
    share = np.sqrt(np.minimum(1.0, lasting / duration))
    return 1.0 / float(np.max(np.sqrt(np.abs(modes) ** 3 * lasting * share)))


def _amplitude(signal: Signal) -> float:
    """Upper bound of a signal's magnitude."""
    match signal:
        case Sine():
            return abs(signal.amplitude)
        case MultiSine():
            return sum(abs(amplitude) for amplitude in signal.amplitudes)
        case Polyline():
            return max(abs(value) for value in signal.values)
    return 0.0


def _steepest(signal: Signal) -> float:
    """Upper bound of a signal's rate of change per second; jumps do not count."""
    match signal:
        case Sine():
            return 2.0 * math.pi * signal.frequency * abs(signal.amplitude)
        case MultiSine():
            parts = zip(signal.amplitudes, signal.frequencies, strict=True)
            return sum(2.0 * math.pi * frequency * abs(each) for each, frequency in parts)
        case Polyline():
            rises, runs = np.diff(signal.values), np.diff(signal.times)
            ramps = runs > 0.0
            return float(np.max(np.abs(rises[ramps] / runs[ramps]), initial=0.0))
    return 0.0
