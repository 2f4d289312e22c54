"""Virtual experiments on a friction model: trials on the scale of its parameter set, and numbers.

Four come from other experiments (Figures 2.8 to 2.10 and 2.12), with options from the scale.
Presliding, drift and dwell time have their own motions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from campaign.channels import FRICTION_TORQUE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Window
from campaign.experiments import force_rate, friction_lag, stribeck_curve
from campaign.experiments.interface import ChangedTrial, Experiment, TrialData
from campaign.experiments.model_properties.parameter_set import Scale
from campaign.experiments.model_properties.rules import CLOSES, LOSS, REVERSIBLE
from campaign.experiments.presliding_hysteresis import loop_sizes
from campaign.experiments.stick_slip import EXPERIMENT as STICK_SLIP
from campaign.physics.bench import Bench
from campaign.reason import Cause
from campaign.result import Array
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest

COMPUTED = Cause(
    "computed without noise", "computed without noise; its error is that of the time step"
)
SLOWEST_RAMP = 1e-3
"""of sigma0 vs; three decades faster, a bristle takes Ts/sigma0/vs to deflect."""
FREQUENCIES = (0.04, 0.4)
"""of vs / (2 pi Ts/sigma0), around a rate of 1.3 vs."""
PULL, SOFT, STIFF = 20.0, 0.3, 100.0
"""Rate of the pull over vs; factors of the stiffness in `_pull`: rest of 0.4 and 0.03 periods."""
PERIODS = 14
"""Periods in a pull."""
PATH = (0.0, 1.0, -1.0, 1.0, -1.0, 0.2, -0.3, 0.2, 1.0)
"""Turning points in presliding, over s(0) / 2 sigma0: a loop twice, then an inner loop."""
SEGMENT, PIECES = 4.0, 50
"""Time (s) between turning points, and number of linear pieces of rate in it."""
HELD, SHAKEN, CYCLES = 0.4, 0.2, 100
"""of Tc: constant torque and amplitude of vibration; number of cycles, with ten to settle."""
RISE = 0.01
"""of Ts - Tc: smallest rise of fast sliding above the dip."""
DWELLS = (0.01, 1.0, 100.0)
"""Dwell times (s)."""


def _moved(command: Polyline, windows: tuple[Window, ...], rate: float) -> TrialRequest:
    stop = windows[-1].stop
    task = Task(
        mode="prescribed", command=command, duration=stop, window=(0.0, stop), sample_rate=rate
    )
    return TrialRequest(task, windows=windows)


def _ramps(scale: Scale) -> Mapping[str, Any]:
    rates = SLOWEST_RAMP * scale.stiffness * scale.velocity * 10.0 ** np.arange(4.0)
    # Far beyond the full deflection of bristles, even on the fastest ramp.
    slides = PULL * scale.velocity
    past = math.sqrt(2.0 * slides * scale.inertia * rates[-1]) + scale.viscous * slides
    return {
        "torque_rates": rates.tolist(),
        "peak_torque": 1.5 * (scale.static + past),
        "sliding_rate": slides,
    }


def _steady(scale: Scale) -> Mapping[str, Any]:
    return {
        "speeds": [scale.velocity * times for times in (0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 200.0)],
        "settle_angle": 50.0 * scale.deflection,
    }


def _lag(scale: Scale) -> Mapping[str, Any]:
    corner = scale.velocity / (2.0 * math.pi * scale.deflection)
    return {
        "mean_rate": 1.3 * scale.velocity,
        "amplitude": 1.1 * scale.velocity,
        "frequencies": [share * corner for share in FREQUENCIES],
    }


def _pull(scale: Scale, stiffness: float) -> Mapping[str, Any]:
    """Through a spring of `stiffness` times ((Ts - Tc) / v)^2 / J, where v is the rate of the pull.

    At a factor of 1, a load released at Ts reaches a rate of v above the pull.
    """
    rate = PULL * scale.velocity
    stiffness *= (scale.excess / rate) ** 2 / scale.inertia
    turned = math.sqrt(stiffness / scale.inertia)
    period = 2.0 * scale.excess / (stiffness * rate) + 2.0 * math.pi / turned
    return {
        "stiffness": stiffness,
        "pull_rate": rate,
        "duration": scale.static / (stiffness * rate) + PERIODS * period,
        "slip_rate": rate,
        "sample_rate": max(200.0, 20.0 * turned),
    }


def _presliding(scale: Scale) -> TrialRequest:
    """Motion along `PATH`; the rate of each segment is half a sine."""
    steps = scale.amplitude * np.diff(PATH)
    phase = np.arange(1, PIECES + 1) / PIECES
    shape = 0.5 * math.pi * np.sin(math.pi * phase) / SEGMENT
    # Linear pieces of a sine enclose slightly less area than the sine.
    shape /= float(np.trapezoid(np.append(0.0, shape), dx=SEGMENT / PIECES))
    times = SEGMENT * (np.arange(len(steps))[:, None] + phase).ravel()
    rates = np.outer(steps, shape).ravel()
    windows = tuple(
        Window(f"to {end:g}, {k + 1}", k * SEGMENT, (k + 1) * SEGMENT)
        for k, end in enumerate(PATH[1:])
    )
    command = Polyline(times=(0.0, *map(float, times)), values=(0.0, *map(float, rates)))
    return _moved(command, windows, 100.0)


def _drift(scale: Scale) -> TrialRequest:
    frequency = 0.1 * scale.natural_rate / (2.0 * math.pi)
    phase = np.arange(CYCLES * 40 + 1) / 40.0
    shaken = HELD + SHAKEN * np.sin(2.0 * math.pi * phase)
    times = (0.0, *((1.0 + phase) / frequency))
    torque = Polyline(
        times=tuple(map(float, times)), values=(0.0, *map(float, scale.coulomb * shaken))
    )
    stop = (1.0 + CYCLES) / frequency
    windows = (
        Window("cycle 10", 10.0 / frequency, 11.0 / frequency),
        Window("cycle 100", stop - 1.0 / frequency, stop),
    )
    task = Task(
        mode="spring",  # of no stiffness: a free load
        disturbance=torque,
        duration=stop,
        window=(0.0, stop),
        sample_rate=20.0 * frequency,
    )
    return TrialRequest(task, windows=windows)


def _dwell(scale: Scale, rest: float) -> TrialRequest:
    """Motion with a rest between two slides; rate and bristles before it are always the same."""
    time = 30.0 * scale.deflection / scale.velocity
    short = 0.1 * scale.deflection / scale.velocity
    again = short + time + short + rest
    command = Polyline(
        times=(0.0, short, short + time, 2.0 * short + time, again, again + short),
        values=(0.0, scale.velocity, scale.velocity, 0.0, 0.0, scale.velocity),
    )
    windows = (Window("slides again", again, again + time),)
    return _moved(command, windows, 20.0 * scale.velocity / scale.deflection)


@dataclass(frozen=True)
class Part:
    """A virtual experiment.

    Attributes:
        requests: its trials, from the scale and any bench.
        measure: numbers by name, from a recording and the scale.
        requires: necessary channels.
    """

    requests: Callable[[Scale, Bench], Iterable[TrialRequest]]
    measure: Callable[[TrialData, Scale], Mapping[str, float]]
    requires: frozenset[str] = frozenset({FRICTION_TORQUE, RELATIVE_ANGLE})


def _like(experiment: Experiment, options: Callable[[Scale], Mapping[str, Any]]) -> Part:
    """A part with the trials and metrics of another experiment."""
    own: Any = experiment.measure

    def chosen(scale: Scale) -> Any:
        return experiment.options.model_validate(options(scale), context={"si": True})

    def measure(data: TrialData, scale: Scale) -> Mapping[str, float]:
        like = ChangedTrial(data, (), options=chosen(scale).model_dump(mode="json"))
        return {each.name: each.value for each in own(like)}

    needed = frozenset(experiment.requires)
    return Part(lambda scale, bench: experiment.trials(chosen(scale), bench), measure, needed)


def _pulled(stiffness: float) -> Part:
    whole = _like(STICK_SLIP, lambda scale: _pull(scale, stiffness))
    return Part(
        whole.requests,
        lambda data, scale: {"rests": whole.measure(data, scale).get("stick_slip_rests", math.nan)},
        whole.requires | {RELATIVE_ANGLE},
    )


def presliding_numbers(data: TrialData, scale: Scale) -> Mapping[str, float]:
    """Reversible share, loss factor, and closure of the inner loop."""
    recording, amplitude = data.recording(), scale.amplitude
    x, torque = recording[RELATIVE_ANGLE], recording[FRICTION_TORQUE]
    ends = np.searchsorted(recording.time, SEGMENT * np.arange(len(PATH)) - 1e-9)
    outer = abs(float(torque[ends[1]]))
    back = slice(ends[1], ends[2] + 1)
    below = np.flatnonzero(torque[back] <= 0.0)
    zero = amplitude
    if len(below) and outer:
        around = slice(ends[1] + max(int(below[0]) - 1, 0), ends[1] + int(below[0]) + 1)
        zero = float(np.interp(0.0, torque[around][::-1], x[around][::-1]))
    loop = slice(ends[1], ends[3] + 1)
    loss = loop_sizes(x[loop], torque[loop], amplitude)["loss_factor"]
    missed = abs(float(torque[ends[7]] - torque[ends[5]])) / max(outer, 1e-12)
    return {
        "reversible_share": max(1.0 - zero / amplitude, 0.0),
        "loss_factor": loss,
        "closure": CLOSES / max(missed, 1e-6),
    }


def _drift_numbers(data: TrialData, scale: Scale) -> Mapping[str, float]:
    """Drift margin from the means of two cycles: within each an undamped load oscillates."""
    recording = data.recording()
    first, last = (
        float(np.mean(recording.window(each.start, each.stop)[RELATIVE_ANGLE]))
        for each in data.trial.windows
    )
    drift = abs(last - first) / (CYCLES - 10)
    return {"drift_margin": 1e-3 * scale.coulomb / scale.stiffness / max(drift, 1e-18)}


def _dwell_numbers(data: TrialData, scale: Scale) -> Mapping[str, float]:
    window = data.trial.windows[0]
    torque = data.recording().window(window.start, window.stop)[FRICTION_TORQUE]
    return {"breakaway_after_rest": float(np.max(torque))}


PARTS: Mapping[str, Part] = {
    "ramp": _like(force_rate.EXPERIMENT, _ramps),
    "steady sliding": _like(stribeck_curve.EXPERIMENT, _steady),
    "swing": _like(friction_lag.EXPERIMENT, _lag),
    "soft spring": _pulled(SOFT),
    "stiff spring": _pulled(STIFF),
    "presliding": Part(lambda scale, bench: [_presliding(scale)], presliding_numbers),
    "vibration": Part(lambda scale, bench: [_drift(scale)], _drift_numbers),
    "rest": Part(
        lambda scale, bench: [
            replace(_dwell(scale, rest), point={"rest": rest}) for rest in DWELLS
        ],
        _dwell_numbers,
    ),
}


def requests(scale: Scale, bench: Bench) -> Iterator[TrialRequest]:
    """All trials of a model; the point of each states its part."""
    for name, part in PARTS.items():
        for request in part.requests(scale, bench):
            point = {"part": name, **request.point}
            yield replace(request, point=point, requires=part.requires)


def estimates(data: TrialData, scale: Scale) -> Sequence[Estimate]:
    """Numbers of a recording, SI."""
    sizes = PARTS[str(data.trial.point["part"])].measure(data, scale)
    return [Estimate.without_interval(name, value, "", COMPUTED()) for name, value in sizes.items()]


Measured = Sequence[tuple[Mapping[str, Any], Mapping[str, Estimate]]]
"""Point and metrics of each trial of a model."""


def numbers_of(found: Measured, scale: Scale) -> dict[str, float]:
    """Input of the rules by name, from all trials of a model.

    Raises ValueError if a number is not determined: no mark follows from it.
    """

    def value(point: Mapping[str, Any], measured: Mapping[str, Estimate], name: str) -> float:
        if not math.isfinite(measured[name].value):
            raise ValueError(f"{name.replace('_', ' ')} is not determined ({point['part']})")
        return measured[name].value

    def of(part: str, along: str, name: str) -> Array:
        own = {float(p[along]): value(p, m, name) for p, m in found if p["part"] == part}
        return np.array([own[at] for at in sorted(own)])

    def single(part: str, name: str) -> float:
        return next(value(p, m, name) for p, m in found if p["part"] == part)

    ramps = of("ramp", "torque_rate", "breakaway_torque")
    speeds, sliding = (of("steady sliding", "speed", name) for name in ("rate", "friction_torque"))
    sliding, speeds = sliding[speeds > 0.0], speeds[speeds > 0.0]
    slope = (sliding[-1] - sliding[-2]) / (speeds[-1] - speeds[-2])
    coulomb = sliding[-1] - slope * speeds[-1]
    slow, fast = of("swing", "frequency", "friction_lag_width")
    rested = of("rest", "rest", "breakaway_after_rest")
    excess = scale.excess
    presliding = {
        name: single("presliding", name) for name in ("reversible_share", "loss_factor", "closure")
    }
    loses = presliding["loss_factor"] >= LOSS
    reversible = presliding["reversible_share"] >= REVERSIBLE
    # A spring has no loop to close, and dry sliding has no presliding.
    closure = presliding["closure"] if loses and reversible else 0.0
    return {
        "reversible_share": presliding["reversible_share"],
        "closure": closure,
        "hysteresis_with_memory": float(closure >= 1.0),
        "coulomb_share": coulomb / scale.coulomb,
        "viscous_share": slope / scale.viscous,
        "stiction_share": (ramps[0] - coulomb) / excess,
        "dip_share": (sliding[0] - sliding.min()) / excess,
        "rise_share": (sliding[-1] - sliding.min()) / excess - RISE,
        "lag_share": fast / excess,
        "lag_vanishes": float(slow <= 0.5 * fast),
        "breakaway_fall": (ramps[0] - ramps[-1]) / excess,
        "rests": single("soft spring", "rests"),
        "smooth_when_stiff": float(single("stiff spring", "rests") == 0.0),
        "drift_margin": single("vibration", "drift_margin"),
        "dwell_rise": (rested[-1] - rested[0]) / excess,
    }
