"""A run nobody executed with results nobody measured: to see what a report makes of it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from campaign.archive.layout.full_plan import FullPlan
from campaign.archive.layout.header import PlannedTrial, RunHeader
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError
from campaign.experiments.interface import Experiment, TestData
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.recording import ChannelInfo, Ending, Outcome, Recording, SafeState
from campaign.report.build import Report, build_report
from campaign.result import Axis, Column, Curve, Figure, Finding, Mark, Panel, Result, Table
from campaign.trial import Task, Trial
from campaign.units import AngularAcceleration, Frequency

ROOT = Path(__file__).resolve().parents[2]
TEMPLATES = ROOT / "templates"
SHAKEN = {"acceleration": np.deg2rad(18.0), "frequency": 0.24}
TIME = Axis("Time", "s", "s")
METHODS = {
    "none": "no compensation",
    "static": "static model",
    "lugre": "LuGre",
    "observer": "observer",
}


def build(run: RunReader, output: Path, **more: object) -> Report:
    """The report of a made-up run; `more`: as of `build_report`."""
    options = {"experiments": EXPERIMENTS, "packaged_templates": TEMPLATES}
    return build_report(run, output, **(options | more))


class ShakeOptions(Options):
    frequency: Frequency = 0.24
    acceleration: AngularAcceleration = float(np.deg2rad(18))
    compensation: str = "none"


def stabilization(data: TestData) -> Result:
    values = {"none": 0.48841e-3, "static": 0.066e-3, "lugre": 0.000595e-3, "observer": 0.000813e-3}
    t = np.linspace(0, 8, 40_000)
    swing = np.deg2rad(12) * np.sin(2 * np.pi * 0.24 * t)
    curves = [
        Curve(t, np.where(np.abs(swing) < w, 0, swing), METHODS[name], name)
        for name, w in zip(METHODS, (0.02, 0.008, 0.001, 0.002), strict=True)
    ]
    rate = Axis("Rate relative to the hull", "rad/s", "deg/s")
    zoom = Axis("Time", "s", "s", limits=(1.95, 2.25))
    near = Axis(rate.label, "rad/s", "deg/s", limits=(-0.05, 0.05))
    rates = Figure(
        "relative-rate",
        "Rate of the load relative to the hull",
        "Where the relative rate passes zero the load sticks to the hull.",
        "Relative rate over time for four methods, and a zoom on one reversal.",
        (Panel(TIME, rate, curves, "Base motion"), Panel(zoom, near, curves, "At a reversal")),
        ("5.4", "5.18"),
        across=2,
    )
    noise = np.random.default_rng(1).normal(size=len(t))
    panels = tuple(
        Panel(
            TIME,
            Axis("Position error", "rad", "mrad"),
            [Curve(t, v * (np.sin(2 * np.pi * 0.24 * t) ** 9 + 0.1 * noise), METHODS[k], k)],
            METHODS[k],
        )
        for k, v in values.items()
    )
    errors = Figure(
        "position-error",
        "Position error by compensation method",
        "The error jumps at every reversal of the relative rate. The scales differ.",
        "Position error over time, one panel per method, with peaks at the reversals.",
        panels,
        ("5.9",),
        across=2,
    )
    findings = tuple(
        Finding("stabilization_error", v, "rad", {**SHAKEN, "compensation": k})
        for k, v in values.items()
    )
    table = Table(
        "stabilization-error",
        "Stabilization error by compensation method",
        (
            Column("compensation", "Compensation"),
            Column("frequency", "Frequency", "Hz", "Hz"),
            Column("error", "Error (1σ)", "rad", "mrad"),
            Column("stuck", "Time stuck", "", "percent"),
        ),
        tuple(
            {
                "compensation": k,
                "frequency": 0.24,
                "error": v,
                "stuck": 0.13 if k == "none" else 0.0,
            }
            for k, v in values.items()
        ),
        ("5.2", "5.8"),
        "The error is the standard deviation of the integrated gyro rate over whole cycles.",
    )
    return Result(
        (table,), (rates, errors), findings, ("One trial per method: no spread is known.",)
    )


def velocity_map(data: TestData) -> Result:
    v = np.geomspace(np.deg2rad(0.05), np.deg2rad(65), 80)
    noise = np.random.default_rng(2).normal(scale=0.5, size=80)

    def curve(ts: float, tc: float, vs: float, viscous: float) -> np.ndarray:
        return tc + (ts - tc) * np.exp(-(v / vs)) + viscous * v

    up, down = curve(32.7, 25.3, 0.0271, 3.87), -curve(35.1, 26.7, 0.0291, 4.27)
    speed, torque = Axis("Rate", "rad/s", "deg/s"), Axis("Friction torque", "N m", "N m")
    both = np.concatenate((-v[::-1], v))
    fit = np.concatenate((down[::-1], up))
    whole = Panel(
        speed,
        torque,
        [
            Curve(both, fit + 1.2, "", "fit", "band", fit - 1.2),
            Curve(both, fit + np.concatenate((noise, noise)), "measured", "measured", "points"),
            Curve(both, fit, "fit", "fit"),
        ],
        "Both directions",
    )
    low = Panel(
        Axis("Rate", "rad/s", "deg/s", "log"),
        torque,
        [Curve(v, up + noise, "measured", "measured", "points"), Curve(v, up, "fit", "fit")],
        "Stribeck region",
        [Mark("vs", x=0.0271), Mark("Tc", y=25.3)],
    )
    figure = Figure(
        "map",
        "Friction torque over rate",
        "Measured points and the fit; the band is the 95 % interval.",
        "Friction torque over rate with a Stribeck peak near zero.",
        (whole, low),
        ("4.11",),
        across=2,
    )
    found = {
        "positive": (3.9, 25.2, 32.9, 0.0275, 0.97),
        "negative": (4.3, 26.8, 35.0, 0.0290, 0.84),
        "nominal": (4.1, 26.0, 33.95, 0.02825, 0.905),
    }
    quantities = (
        ("viscous_friction", "N m s/rad"),
        ("coulomb_torque", "N m"),
        ("static_torque", "N m"),
        ("stribeck_velocity", "rad/s"),
        ("stribeck_exponent", ""),
    )
    findings = tuple(
        Finding(q, value, unit, {"direction": direction})
        for direction, values in found.items()
        for (q, unit), value in zip(quantities, values, strict=True)
    )
    return Result((), (figure,), findings)


def broken(data: TestData) -> Result:
    raise ValueError("no recording reached breakaway\nsecond line")


EXPERIMENTS = {
    kind: Experiment(kind, kind, ShakeOptions, lambda options, bench: (), analyse)
    for kind, analyse in {
        "stabilization": stabilization,
        "velocity_map": velocity_map,
        "breakaway": broken,
    }.items()
}


def bench(**changes: object) -> Bench:
    path = ROOT / "protocols" / "benches" / "simulink.toml"
    return Bench.model_validate(tomllib.loads(path.read_text()) | changes)


def trial(number: int, kind: str, bench: Bench, **more: object) -> Trial:
    return Trial(
        number=number,
        test=kind.replace("_", "-"),
        kind=kind,
        seed=100 + number,
        bench=bench.model_dump(mode="json"),
        task=Task(mode="rate", duration=10.0, window=(2.0, 10.0), sample_rate=1000.0),
        **more,
    )


class NoSamples:
    """Of a trial that nobody executed; the experiments here look at none."""

    not_kept = ""

    def recording(self, ending: Ending) -> Recording:
        raise ArchiveError("nothing was recorded")

    def channels(self) -> tuple[ChannelInfo, ...]:
        return ()

    def problems(self) -> Iterator[str]:
        return iter(())


def made_up_run(
    folder: Path,
    *,
    tests: dict[str, tuple[str, ...]] | None = None,
    published: str = "",
    bench: Bench | None = None,
    **header: object,
) -> RunReader:
    """Tests are kind to what they reproduce; the last trial of each failed."""
    used = bench or globals()["bench"]()
    wanted = (
        tests
        if tests is not None
        else {
            "stabilization": ("5.2", "5.8", "figure 5.4"),
            "velocity_map": ("4.3", "text 4.2.1"),
            "breakaway": ("4.5",),
        }
    )
    archive = folder / "made-up.nxs"
    archive.write_bytes(b"not really HDF5")
    trials = []
    for kind in wanted:
        for compensation in METHODS:
            number = len(trials) + 1
            ending = Ending(Outcome.COMPLETED)
            if compensation == "observer":
                ending = Ending(Outcome.LIMIT, "current 93.1 A is over the limit of 90 A")
            point = {"compensation": compensation}
            made_up = trial(number, kind, used, point=point)
            trials.append(ArchivedTrial(made_up, ending, "", "", archive, "", NoSamples()))
    sources = {"made-up.toml": '[[test]]\nkind = "stabilization"\n'}
    normalised: dict[str, object] = {}
    if published:
        sources["own.toml"] = published
        normalised["published"] = "own.toml"
    facts: dict[str, object] = {
        "name": "2026-11-21T09-36-58-made-up",
        "created": "2026-11-21T09:36:58+00:00",
        "title": "Friction compensation on the simulated bench",
        "description": "A short version of the three experiments, to see the whole line once.",
        "protocol_name": "made-up",
        "backend": "sim",
        "versions": {"campaign": "0.1.0", "numpy": "2.4.6"},
        "host": {"system": "Linux", "machine": "x86_64"},
        "fingerprint": "ab" * 32,
        "sources": sources,
        "normalised": normalised,
        "tests": tuple(
            {
                "name": kind.replace("_", "-"),
                "kind": kind,
                "title": kind.replace("_", " ").capitalize(),
                "description": "What the test is for, in a sentence or two.",
                "reproduces": [*reproduces, "figure 4.11", "figure 5.4", "figure 5.9"],
                "options": {"frequency": 0.24, "acceleration": 0.3141592653589793},
            }
            for kind, reproduces in wanted.items()
        ),
        "trials": len(trials),
    }
    return RunReader(
        path=archive,
        header=RunHeader.model_validate(facts | header),
        status=RunStatus.FAILED_TRIALS,
        reason="",
        safe_state=SafeState.CONFIRMED,
        ended="2026-11-21T09:37:58+00:00",
        plan=tuple(PlannedTrial.of(t.trial) for t in trials),
        trials=tuple(trials),
        story=read_lines(b""),
        full_plan=FullPlan(archive, lambda: ("", "")),
    )
