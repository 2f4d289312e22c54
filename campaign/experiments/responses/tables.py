"""Tables of responses: setup, distortion in the band and line by line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.frequency.best_linear import BestLinear
from campaign.estimation.frequency.distortion import WITHIN_NOISE, Distortion, Level, Parity, total
from campaign.estimation.intervals import LEVEL
from campaign.experiments.responses.sources import Source
from campaign.reason import Cause
from campaign.result import Column, Table

NAME = Column("source", "Response", exact=True)
SENSOR = Column("side", "Sensor", exact=True)
EXCITATION = Column("excitation", "Excitation", exact=True)
LEVEL_ONLY = Cause("level", "a level, not a number of the rig")
NOT_FROM_ZERO = Cause("not distinguishable from zero", "not distinguishable from zero")
ONE_REALISATION = Cause("distortion not shown", "a single realisation does not show it")


def sources_table(found: Sequence[Source]) -> Table:
    """Excitation of each response, for which its best linear approximation holds."""
    rows: list[dict[str, Any]] = [
        {
            "source": each.name,
            "excitation": each.excitation,
            "trials": len(each.trials),
            "points": max(len(r.frequency) for r in each.responses.values()),
        }
        for each in found
    ]
    return Table(
        "responses",
        "Responses and their measurement",
        (
            NAME,
            EXCITATION,
            Column("trials", "Trials", exact=True),
            Column("points", "Frequencies", exact=True),
        ),
        tuple(rows),
        note="Of a nonlinear drive each response holds for its own excitation.",
    )


def distortion_tables(found: Sequence[Source]) -> Iterator[Table]:
    """Distortion of the whole band and of each line; nothing if no source has any."""
    rows: list[dict[str, Any]] = []
    lines: list[dict[str, Any]] = []
    for each in found:
        for side, best in each.best.items():
            if best.distortion is None:
                continue
            own = {"source": each.name, "side": side}
            totals = _totals(best.distortion)
            levels = {f"{name}_level": _decibels(one) for name, one in totals.items()}
            rows.append({**own, **totals, **levels, "excitation": each.excitation})
            lines += [{**own, **line} for line in _lines(best, best.distortion)]
    if not rows:
        return
    yield Table(
        "distortion",
        "Distortion over the output",
        (
            NAME,
            SENSOR,
            Column("even", "Even", "", "%"),
            Column("odd", "Odd", "", "%"),
            Column("even_level", "Even", "dB", "dB"),
            Column("odd_level", "Odd", "dB", "dB"),
            EXCITATION,
        ),
        tuple(rows),
        note="Rms over the whole band over that of the output, from lines without excitation, less "
        "noise and the input's own part there. Odd distortion includes what scatters over "
        "realisations at the excited lines. Coulomb friction and "
        "a bristle are odd; what differs by direction is even. Levels of other benches compare "
        "only at a like excitation: its rms, band and lines stand beside them.",
    )
    yield Table(
        "distortion-lines",
        "Distortion line by line",
        (
            NAME,
            SENSOR,
            Column("line", "Line", exact=True),
            Column("frequency", "Frequency", "Hz", "Hz", exact=True),
            Column("output", "Output, dB of its unit", reason=LEVEL_ONLY()),
            Column("level", "Distortion over output", "dB", "dB"),
            Column("noise", "Noise over output, dB", reason=LEVEL_ONLY()),
            Column("recorded", "As recorded, dB", reason=LEVEL_ONLY()),
        ),
        tuple(lines),
        note="Over the linear output, that is the best linear approximation times the excitation, "
        "at the same frequency (between excited lines interpolated). At detection lines (even, "
        "odd) distortion is what the output has there; at excited lines it is the scatter of one "
        "realisation less the noise. All are rms values of single lines of one realisation. "
        "As recorded: the output there with what the input itself has at that line, and noise.",
    )


def distortion_of(source: Source) -> list[Estimate]:
    """Even and odd distortion of the band, first sensor; empty without one."""
    distortion = next((each.distortion for each in source.best.values()), None)
    return [] if distortion is None else list(_totals(distortion).values())


def _totals(distortion: Distortion) -> dict[str, Estimate]:
    return {"even": total(distortion, "even"), "odd": total(distortion, "odd")}


def _decibels(share: Estimate) -> Estimate:
    """The level (dB) of a ratio of amplitudes."""
    name, value = f"{share.name}_level", _db(share.value)
    if share.kind == "at most":
        return Estimate(name, value, "dB", method=share.method, kind="at most", reason=share.reason)
    if share.low is None or share.high is None or not share.low > 0:
        return Estimate.without_interval(
            name, value, "dB", share.reason or NOT_FROM_ZERO(), method=share.method
        )
    return Estimate(
        name, value, "dB", _db(share.low), _db(share.high), LEVEL, share.method,
        freedom=share.freedom,
    )  # fmt: skip


def _lines(best: BestLinear, distortion: Distortion) -> Iterator[dict[str, Any]]:
    """Rows of excited and detection lines, by frequency."""
    at = best.response.frequency
    output = np.sqrt(distortion.excited)
    rows = list(_excited(best, output))
    parities: tuple[tuple[Parity, Level], ...] = (
        ("even", distortion.even),
        ("odd", distortion.odd),
    )
    for name, level in parities:
        beside = np.exp(np.interp(np.log(level.frequency), np.log(at), np.log(output)))
        low, high = level.interval()
        for k, frequency in enumerate(level.frequency):
            rows.append(
                {
                    "line": name,
                    "frequency": float(frequency),
                    "output": _db(float(beside[k])),
                    "level": _level(level, low, high, beside, k),
                    "noise": _db(math.sqrt(float(level.noise[k])) / float(beside[k])),
                    "recorded": _db(math.sqrt(float(level.recorded[k])) / float(beside[k])),
                }
            )
    rows.sort(key=lambda row: float(row["frequency"]))
    yield from rows


def _level(level: Level, low: Array, high: Array, beside: Array, k: int) -> Estimate:
    method = "power at a line without excitation less noise"
    # The subtracted noise is an estimate: no bound lies below its level.
    most = _db(max(float(high[k]), math.sqrt(float(level.noise[k]))) / float(beside[k]))
    if not level.significant[k] or not level.rms[k] > 0:
        return _within_noise(most, method)
    value = _db(float(level.rms[k] / beside[k]))
    least = _db(float(low[k] / beside[k])) if low[k] > 0 else None
    return Estimate("distortion", value, "dB", least, max(most, value), LEVEL, method)


def _within_noise(most: float, method: str) -> Estimate:
    return Estimate("distortion", most, "dB", method=method, kind="at most", reason=WITHIN_NOISE())


def _excited(best: BestLinear, output: Array) -> Iterator[dict[str, Any]]:
    from scipy.stats import chi2

    count = best.excitation.realisations
    size = np.abs(best.response.values)
    freedom = 2 * (count - 1)
    for k, frequency in enumerate(best.response.frequency):
        noise = math.sqrt(count * float(best.noise[k])) / float(size[k])
        whole = math.sqrt(count * float(best.response.variance[k])) / float(size[k])
        method = "scatter over realisations less noise"
        if count < 2:
            level = Estimate.without_interval("distortion", math.nan, "dB", ONE_REALISATION())
        else:
            ends = [
                max(whole**2 * freedom / chi2.ppf(share, freedom) - noise**2, 0.0)
                for share in (0.5 + 0.5 * LEVEL, 0.5 - 0.5 * LEVEL)
            ]
            own = max(whole**2 - noise**2, 0.0)
            if own > 0 and ends[0] > 0:
                level = Estimate(
                    "distortion", 0.5 * _db(own), "dB", 0.5 * _db(ends[0]), 0.5 * _db(ends[1]),
                    LEVEL, method,
                )  # fmt: skip
            else:
                level = _within_noise(_db(max(math.sqrt(ends[1]), noise)), method)
        yield {
            "line": "excited",
            "frequency": float(frequency),
            "output": _db(float(output[k])),
            "level": level,
            "noise": _db(noise),
            "recorded": 0.0,
        }


def _db(value: float) -> float:
    """20 log10; NaN if not finite."""
    return 20.0 * math.log10(max(value, 1e-15)) if math.isfinite(value) else math.nan
