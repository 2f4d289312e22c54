"""The integration step of a trial from its bench and task.

Everything linear is exact at any step (`campaign.physics.loop.discretise`). What a step must
resolve is friction with bristles, and what it excites. At the load, with sums over the interfaces
that have bristles, and J without the appendage:

    tau_c = J / sum of sigma1        the bristles' damping. The engine predicts the rate at the end
                                     of a step with the torques held, which is stable only while
                                     h sum(sigma1) / J is well below 1.
    tau_k = sqrt(J / sum of sigma0)  the load on its bristles, as on a spring.
    tau_r = sqrt(z / a)              how long a reversal takes to bend the bristles over. z is
                                     sum of s / sum of sigma0, s the least torque of steady sliding;
                                     a the amplitude of the base's acceleration plus that of a rate
                                     command. Behind a low-pass of time T a friction model that
                                     compensates meets a hull under way at v0 with v0 / T more.
    tau_p = 1 / max |p|              the fastest pole p of what is continuous, stuck on bristles:
                                     the loop with controller and compensation, or only the load.
    tau_l                            the same of the load alone on its bristles.
    tau_o                            ringing over the whole trial, see `_ringing`.

What is wrong after one reversal is of second order both in h / tau_r, as the bristles bend, and in
h / tau_p, as the loop answers: their geometric mean counts, which no derivation gives, but which
fits the benches below better than either. Each limit is a constant times a time; the least decides:

    DAMPING tau_c                 always
    REVERSAL sqrt(tau_p tau_r)    where base or command reverse the rate
    HELD tau_l                    where the hull is under way when the trial begins, and then shakes
                                  the load with less than a tenth of its friction: nothing that
                                  follows is as large as what the start leaves
    RESTING tau_k                 under a commanded torque, or pulled through a spring
    RINGING tau_o                 always
    JUMPS tau_p                   where the friction or its compensation jumps, and the loop answers
    FED tau_p                     where both do: what is left is the difference of two jumps
    DRY                           where friction is dry
    OWN times `fastest`           of each model that states a time of its own

JUMPS, FED and DRY are for dry friction, bristles or not: what compensates it passes its jumps on to
the fast poles, which a step meets by their mean and first moment alone. Against the event-switched
reference (benchmarks/dry_friction.py) the largest error of a channel of the thesis' loop is then
2.7e-4; at 1 ms it was 1.5e-3, and 2.7e-3 behind the observer. Against the engine itself at 1/128
ms, over nine curves in modes rate and torque and over five static compensations, exact and not,
each of 1 to 2 s, no channel is off by 1e-3. Not so the friction torque where it jumps once in a
second, which a single sample may show on the wrong side (2.9e-3); nor curves that rise infinitely
steep from rest: 4.6e-3 with a Stribeck exponent of 0.2.

Evidence for the others: random benches (tests/physics/random_benches.py) with continuous control,
in modes rate and torque, against scipy's LSODA at 1e-10. The error is that of a channel over 5 s,
relative to its RMS; the largest of all channels counts. Form and constants were chosen with 235
ordinary and 114 extreme benches in view. Then 140 ordinary and 60 extreme ones that nobody had seen
were tried: one extreme one is refused, one has a reference that does not agree with itself (its
rate and what compensates by it, 1e-4 of the friction torque), and the largest error of the others
is 4.0e-4. `make soak` runs 200 others: two extreme ones are refused, none is off by 1e-3. Mostly
steps are 4 times shorter than needed. Sampled controllers and springs have no such reference: for
them this is an extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.physics.base_motion import base_rate
from campaign.physics.compensation.interface import Compensator
from campaign.physics.complete import CompleteBench
from campaign.physics.friction import friction_models, is_dry, jumps
from campaign.physics.friction.interface import FrictionOptions, Presliding
from campaign.physics.loop import at_load, make_compensator, make_loop
from campaign.physics.rows import COMPENSATION, FRICTION, RATE, RELATIVE_ANGLE
from campaign.signals import MultiSine, Polyline, Signal, Sine
from campaign.trial import Task

Poles = NDArray[np.complex128]

LONGEST = 1e-3
"""s."""
HALVINGS = 10
"""Steps are LONGEST / 2^k, k = 0 .. HALVINGS."""
DAMPING, REVERSAL, HELD, RESTING, RINGING = 0.2, 0.05, 0.03, 0.05, 0.2
JUMPS, FED, OWN = 1.5, 0.09, 0.25
DRY = LONGEST / 4.0
"""s."""
BARELY_SHAKEN = 0.1
"""Of friction: J times the base's acceleration, below which HELD counts."""
AT_REST = 1e-9
"""rad/s; a sine that begins at its crest leaves this much by rounding."""
STANDING = 1.0
"""1/s; slower poles are integrators and do not ring."""
SPEEDS = np.concatenate([side * np.logspace(-7.0, 2.0, 91) for side in (-1.0, 1.0)])
"""rad/s at the interface, at which the least torque of steady sliding is looked for."""


@dataclass(frozen=True)
class StepChoice:
    """The step of a trial.

    Attributes:
        step: s, LONGEST / 2^k; the finest there is when the trial is refused.
        needed: s, what was rounded down to it; LONGEST when no more is needed.
        because: what decided, in plain words.
        refused: what is too stiff for the finest step; None when nothing is.
    """

    step: float
    needed: float
    because: str
    refused: str | None = None


@dataclass(frozen=True)
class _Limit:
    """The longest step (s) that one of the rules allows."""

    step: float
    because: str


@dataclass(frozen=True)
class _Contact:
    """One interface with bristles as the load meets it.

    Attributes:
        place: where the bench says it.
        stiffness, damping: N m/rad, N m s/rad.
        torque: the least of steady sliding (N m).
    """

    place: str
    stiffness: float
    damping: float
    torque: float


def longest_step(bench: CompleteBench, task: Task) -> StepChoice:
    """The longest step of the ladder that a trial is right with.

    bench: with the friction of the trial, as `variation.as_it_is` gives it. Friction models that do
    not declare their answer to small motions, and dry ones, have no bristles that count here.
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
        model = friction_models()[options.model]  # type: ignore[attr-defined]
        if model.fastest is not None and (fastest := model.fastest(options)) > 0.0:
            yield _Limit(OWN * fastest, f"the fastest time of {place}")


def _contacts(friction: list[tuple[str, FrictionOptions]], bench: CompleteBench) -> list[_Contact]:
    found = []
    for place, options in friction:
        bristles = _bristles(options)
        if bristles is not None:
            model = friction_models()[options.model]  # type: ignore[attr-defined]
            torque, rate = at_load(options, bench)
            sliding = model.steady_state(options, SPEEDS)
            found.append(
                _Contact(
                    place,
                    torque * rate * bristles.stiffness,
                    torque * rate * bristles.damping,
                    torque * float(np.min(np.abs(sliding))),
                )
            )
    return found


def _bristles(options: FrictionOptions) -> Presliding | None:
    """Spring and damper of an interface at rest; None without bristles."""
    model = friction_models()[options.model]  # type: ignore[attr-defined]
    if model.small_signal is None:
        return None
    stuck = model.small_signal(options).stuck
    return stuck if stuck is not None and stuck.stiffness > 0.0 else None


def stuck_poles(bench: CompleteBench, task: Task, compensator: Compensator) -> Poles:
    """Poles (1/s) of the loop at rest, plant and compensation stuck on their bristles."""
    loop = make_loop(bench, "rate" if task.mode == "rate" else "torque", compensator)
    a, low_pass = loop.a.copy(), bench.controller.relative_rate_filter
    for options in bench.friction.values():
        if (bristles := _bristles(options)) is not None:
            at = math.prod(at_load(options, bench))
            a[:, RELATIVE_ANGLE] += loop.b[:, FRICTION] * at * bristles.stiffness
            a[:, RATE] += loop.b[:, FRICTION] * at * bristles.damping
    for options, gain in compensator.friction:
        model = friction_models()[options.model]  # type: ignore[attr-defined]
        stuck = None
        if model.small_signal is not None:
            stuck = model.small_signal(options).stuck_compensation
        if stuck is not None:
            added = loop.b[:, COMPENSATION] * gain * math.prod(at_load(options, bench))
            # Behind the low-pass the bristles move by the angle less what it still holds back.
            a[:, RELATIVE_ANGLE] += added * stuck.stiffness
            a[:, loop.seen] += added * (stuck.damping - low_pass * stuck.stiffness)
    return np.linalg.eigvals(a).astype(complex)


def _load_poles(inertia: float, damping: float, stiffness: float) -> Poles:
    """Poles (1/s) of the load on its bristles, and on the spring that it is pulled through."""
    # As `np.roots` has it, without its search for zeros: there are none.
    return np.linalg.eigvals([[-damping / inertia, -stiffness / inertia], [1.0, 0.0]]).astype(
        complex
    )


def _fastest(poles: Poles) -> float:
    """1/s."""
    return float(np.max(np.abs(poles)))


def _ringing(poles: Poles, duration: float) -> float:
    """tau_o (s): 1 / tau_o^2 is the largest |p|^3 t sqrt(t / T) of a pole p that rings.

    A step of h turns a mode wrong by (h |p|)^2 of its angle. That adds up over the time that the
    mode lasts, t = 1 / (2 max(-Re p, 1 / T)), and is in the record for t of the trial's T, of which
    an RMS takes the square root.
    """
    modes = poles[np.abs(poles) > STANDING]
    if not len(modes):
        return math.inf
    lasting = 1.0 / (2.0 * np.maximum(-modes.real, 1.0 / duration))
    share = np.sqrt(np.minimum(1.0, lasting / duration))
    return 1.0 / float(np.max(np.sqrt(np.abs(modes) ** 3 * lasting * share)))


def _amplitude(signal: Signal) -> float:
    """The most that a signal can be."""
    match signal:
        case Sine():
            return abs(signal.amplitude)
        case MultiSine():
            return sum(abs(amplitude) for amplitude in signal.amplitudes)
        case Polyline():
            return max(abs(value) for value in signal.values)
    return 0.0


def _steepest(signal: Signal) -> float:
    """The most that a signal can change by per second; a jump does not count."""
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
