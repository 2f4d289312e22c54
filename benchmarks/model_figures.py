"""The figures of docs/friction-models.md, computed by the program's own models.

Run with `python -m benchmarks.model_figures`. It writes docs/images/models-*.svg: Figures 2.6, 2.7,
2.13, 3.6, 3.7, 3.8 and 3.11 of the thesis, and loops of models with a state. Parameters are
those of `SET` in protocols/friction_models.toml; what a curve has otherwise is beside it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.document import IMAGES
from campaign.experiments.model_properties.parameter_set import options_of, with_friction
from campaign.physics.bench import Bench
from campaign.physics.complete import complete
from campaign.physics.friction import friction_models
from campaign.physics.rows import OUT_ANGLE, OUT_FRICTION, OUT_RELATIVE_RATE
from campaign.physics.simulate import simulate
from campaign.report.drawing.figures import draw
from campaign.resources import protocols_folder
from campaign.result import Axis, Curve, Figure, Mark, Panel
from campaign.signals import Polyline
from campaign.trial import Task

Array = NDArray[np.float64]

SET = "LuGre 1995"
(TEST,) = tomllib.loads((protocols_folder() / "friction_models.toml").read_text("utf-8"))["test"]
TC, TS, VS, STIFFNESS = 1.0, 1.5, 1e-3, 1e5
"""Of the set: N m, rad/s, N m/rad."""
BENT = TS / STIFFNESS
"""rad: deflection of straight bristles at breakaway."""
SLOW, FAST = 0.02 * VS, 20.0 * VS
"""rad/s: slow enough that bristles do not lag; sliding."""
TORQUE = Axis("Friction torque", "N m")
ANGLE = Axis("Angle", "rad", "urad")
RATE = Axis("Rate", "rad/s", "mrad/s")
STATES = ("dahl", "bliman-sorine", "lugre", "elasto-plastic", "leuven", "gms")
INNER = tuple(BENT * turn for turn in (0.0, 1.0, -1.0, 0.3, -0.4, 0.3, 1.0))
"""Turning points (rad): a loop with another one in it."""


REGIMES = {"presliding": 0.0, "boundary": 0.6, "partial fluid": 1.1, "full fluid": 4.0}
"""Rates of the names of lubrication, in vs."""


def options(model: str, **changes: Any) -> Any:
    """A model with the parameters of the set that it has, and changes."""
    return options_of(model, {**TEST["sets"][SET], **changes}, own=False)


def simulated(own: Any, sample_rate: float, duration: float, **task: Any) -> Array:
    """Angle (rad), rate (rad/s) and friction torque (N m) of a unit inertia, shape (3, n)."""
    text = (protocols_folder() / TEST["bench"]).read_text("utf-8")
    tree = with_friction(Bench.model_validate(tomllib.loads(text)), own)
    bench = complete(Bench.model_validate(tree, context={"si": True}))
    asked = Task(duration=duration, window=(0.0, duration), sample_rate=sample_rate, **task)
    out = np.concatenate([block for _, block in simulate(bench, asked, 1)], axis=1)
    return out[[OUT_ANGLE, OUT_RELATIVE_RATE, OUT_FRICTION]]


def moved(own: Any, times: Any, rates: Any, sample_rate: float) -> Array:
    """The same at prescribed rates (rad/s) over times (s)."""
    command = Polyline(times=tuple(map(float, times)), values=tuple(map(float, rates)))
    return simulated(own, sample_rate, command.times[-1], mode="prescribed", command=command)


def turned(own: Any, turns: Sequence[float]) -> Array:
    """The same, slowly from one turning point (rad) to the next."""
    times, rates = [0.0], []
    for start, end in pairwise(turns):
        times += [times[-1] + abs(end - start) / SLOW] * 2
        rates += [np.copysign(SLOW, end - start)] * 2
    return moved(own, times[:-1], rates, 150.0 * SLOW / BENT)


def pushed(own: Any, torque_rate: float) -> Array:
    """The same under a torque ramp (N m/s), until it slides."""
    peak = 1.5 * (TS + (2.0 * FAST * torque_rate) ** 0.5)
    ramp = Polyline(times=(0.0, peak / torque_rate), values=(0.0, peak))
    found = simulated(own, 4e4, ramp.times[-1], mode="spring", disturbance=ramp)
    return found[:, : int(np.argmax(found[1] > FAST))]


def rested(own: Any, rest: float) -> float:
    """Largest friction (N m) as it slides on after a rest (s)."""
    time, short = 30.0 * BENT / VS, 0.1 * BENT / VS
    times = np.cumsum([0.0, short, time, short, rest, short, time])
    friction = moved(own, times, [0.0, VS, VS, 0.0, 0.0, VS, VS], 20.0 * VS / BENT)[2]
    return float(np.max(friction[round(times[4] * 20.0 * VS / BENT) :]))


def curve(own: Any, top: float) -> tuple[Array, Array]:
    """Rates (rad/s) of both directions and friction (N m) of steady sliding."""
    fast = np.concatenate([[1e-12], np.geomspace(1e-3 * VS, top, 150)])
    rate = np.concatenate([-fast[::-1], fast])
    return rate, friction_models()[own.model].steady_state(own, rate)


def steady_curves() -> Figure:
    """Figures 2.6, 3.6 and 3.7, with more viscous friction than the set has."""

    def panel(title: str, model: str, *marks: Mark, **changes: Any) -> Panel:
        own = options(model, viscous_friction="75 N m s/rad", **changes)
        return Panel(RATE, TORQUE, [Curve(*curve(own, 6.0 * VS), "", "measured")], title, marks)

    whole, values = curve(options("stribeck", viscous_friction="75 N m s/rad"), 6.0 * VS)
    forward = whole > 0.0
    smooth = options("stribeck", viscous_friction="75 N m s/rad", sign_smoothing="0.3 mrad/s")
    swept = moved(smooth, [0.0, 1.0], [-6.0 * VS, 6.0 * VS], 1e3)[1:]
    regimes = [
        Mark(name, x=float(whole[at]), y=float(values[at]), point=True)
        for name, share in REGIMES.items()
        for at in [int(np.searchsorted(whole, share * VS))]
    ]
    return _figure(
        "steady",
        panel("Coulomb and viscous", "coulomb"),
        panel("With static friction", "stribeck", stribeck_velocity="1e-9 rad/s"),
        panel("Stribeck", "stribeck"),
        Panel(RATE, TORQUE, [Curve(swept[0], swept[1], "", "measured")], "Smoothed"),
        panel("Karnopp", "karnopp", Mark("2 DV", x=-VS, until=VS), zero_band="1 mrad/s"),
        Panel(RATE, TORQUE, [Curve(whole[forward], values[forward], "", "measured")],
              "Lubrication", regimes),
    )  # fmt: skip


def breakaways() -> Figure:
    """Figures 2.7 and 2.13, and breakaway over the rate of the torque."""
    ramps = {model: pushed(options(model), 0.3)[[0, 2]] for model in ("stribeck", "lugre")}
    angle, friction = ramps["lugre"]
    peak = int(np.argmax(friction))
    top = 12.0 * BENT
    rates, rests = np.geomspace(0.1, 30.0, 10), np.geomspace(1e-2, 1e2, 9)
    return _figure(
        "breakaway",
        Panel(
            ANGLE, TORQUE,
            [Curve(x[x < top], y[x < top], model, model) for model, (x, y) in ramps.items()],
            "Slow ramp",
            [Mark("breakaway", x=float(angle[peak]), y=float(friction[peak]), point=True)],
        ),
        Panel(
            Axis("Torque rate", "N m/s", scale="log"), Axis("Breakaway torque", "N m"),
            [Curve(rates, np.array([np.max(pushed(options(m), r)[2]) for r in rates]), m, m)
             for m in ("stribeck", "lugre")],
            "Rate of the torque",
        ),
        Panel(
            Axis("Time at rest", "s", scale="log"), Axis("Breakaway torque", "N m"),
            [Curve(rests, np.array([rested(options(m), r) for r in rests]), m, m)
             for m in ("lugre", "armstrong")],
            "Dwell time",
        ),
    )  # fmt: skip


def preslidings() -> Figure:
    """Figures 3.8 and 3.11, and each model with a state."""
    way = 3.0 * TC / STIFFNESS
    forth_and_back = (0.0, way, -way, way)
    flat = {"static_torque": "1 N m", "attraction": "1e6 N m/s", "stribeck_exponent": 2.0}

    def element(count: int, turns: Sequence[float], **extra: Any) -> list[Curve]:
        angle, _, friction = turned(options("gms", elements=count, **flat, **extra), turns)
        first = int(np.argmax(angle)) + 1
        return [
            Curve(angle[first:], friction[first:], "loop", "measured"),
            Curve(angle[:first], friction[:first], "first motion", "static"),
        ]

    def presliding(model: str) -> Panel:
        angle, _, friction = turned(options(model), INNER)
        return Panel(ANGLE, scale, [Curve(angle, friction, "", "measured")], model)

    scale = replace(TORQUE, limits=(-1.4, 1.4))
    dahl = [
        Curve(angle, friction, f"i = {i:g}", f"{i:g}")
        for i in (0.5, 1.0, 2.0)
        for angle, _, friction in [turned(options("dahl", exponent=i), forth_and_back)]
    ]
    inner = (*forth_and_back, 0.2 * way, 0.7 * way, 0.2 * way, way)
    return _figure(
        "presliding",
        Panel(ANGLE, TORQUE, dahl, "Dahl"),
        Panel(ANGLE, TORQUE, element(1, forth_and_back), "One Maxwell-slip element"),
        Panel(ANGLE, TORQUE, element(4, inner), "Four elements"),
        *map(presliding, STATES),
    )


def lags() -> Figure:
    """Friction around a positive rate, of each model with a state."""
    scale = replace(TORQUE, limits=(0.95, 1.55))

    def lag(model: str) -> Panel:
        frequency, count = 0.4 * VS / (2.0 * np.pi * BENT), 160
        times = np.arange(4 * count + 1) / (count * frequency)
        rates = VS * (1.3 + 1.1 * np.sin(2.0 * np.pi * frequency * times))
        _, rate, friction = moved(options(model), times, rates, count * frequency)[:, -count - 1 :]
        steady = np.linspace(0.2 * VS, 2.4 * VS, 100)
        own = options(model)
        still = friction_models()[model].steady_state(own, steady)
        curves = [
            Curve(rate, friction, "swinging rate", "measured", "loop"),
            Curve(steady, still, "steady sliding", "reference"),
        ]
        return Panel(RATE, scale, curves, model)

    return _figure("lag", *map(lag, STATES))


def _figure(key: str, *panels: Panel) -> Figure:
    return Figure(f"models-{key}", "", "", "", panels, across=3)


def main() -> None:
    """Write the pictures."""
    for figure in (steady_curves(), breakaways(), preslidings(), lags()):
        (IMAGES / f"{figure.key}.svg").write_text(draw(figure), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
