"""Tables and findings of measured responses: servo characteristics, elastic modes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.continuation import DECIBEL
from campaign.estimation.elastic_mode import elastic_mode
from campaign.estimation.frequency_response import Response
from campaign.estimation.servo import Crossing, ServoCharacteristics, change
from campaign.experiments.interface import TrialData
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Table, Value
from campaign.signals import Sine
from campaign.units import rate_text


@dataclass(frozen=True)
class Sweep:
    """One response of the test, with its place in the matrix and its servo characteristics."""

    place: dict[str, Value]
    loop: str
    label: str
    response: Response
    found: ServoCharacteristics | None


def method(sweep: Sweep) -> str:
    """Name of the sweep's compensation."""
    return str(sweep.place["compensation"])


QUANTITIES = (
    ("bandwidth", "Bandwidth", "Hz", "Hz"),
    ("gain_margin", "Gain margin", "dB", ""),
    ("phase_margin", "Phase margin", "rad", "deg"),
)


def _values(found: ServoCharacteristics) -> dict[str, Estimate]:
    return {name: getattr(found, name) for name, *_ in QUANTITIES}


def closed_findings(sweep: Sweep) -> Iterator[Finding]:
    """Bandwidth and margins of one closed loop; those beyond the sweep may be bounds."""
    if sweep.found is not None:
        for value in _values(sweep.found).values():
            # An upper bound has no published cell to compare with; only its kind shows it.
            if value.kind != "at most":
                yield Finding.of(value, sweep.place)


def _pairs(sweeps: list[Sweep]) -> Iterator[tuple[Sweep, Sweep]]:
    """Each compensated sweep and the one without compensation, under otherwise equal conditions."""

    def rest(sweep: Sweep) -> dict[str, Value]:
        return {k: v for k, v in sweep.place.items() if k != "compensation"}

    for sweep in sweeps:
        for bare in sweeps:
            if method(bare) == "none" != method(sweep) and rest(bare) == rest(sweep):
                yield bare, sweep


def _changes(bare: Sweep, sweep: Sweep) -> dict[str, Estimate]:
    """Changes by quantity, without quantities that one of the two sweeps only bounds."""
    if bare.found is None or sweep.found is None:
        return {}
    before, after = _values(bare.found), _values(sweep.found)
    by_name = {name: change(f"{name}_change", before[name], after[name]) for name, *_ in QUANTITIES}
    return {name: one for name, one in by_name.items() if one is not None}


def changes(sweeps: list[Sweep]) -> Iterator[Finding]:
    """Changes by compensation, in Hz, dB and rad."""
    for bare, sweep in _pairs(sweeps):
        for value in _changes(bare, sweep).values():
            yield Finding.of(value, sweep.place)


def closed_tables(sweeps: list[Sweep], paths: list[str]) -> Iterator[Table]:
    """Tables 5.3 and 5.9, changes by compensation, and crossings of the margins."""
    named = _place_columns(paths)
    servo, *crossings = margin_tables(sweeps, named)
    yield servo
    yield from _effect_table(named, sweeps)
    yield from crossings


def _place_columns(paths: list[str]) -> tuple[Column, ...]:
    """Columns of the compensation and of the other swept paths."""
    others = (Column(path, path, exact=True) for path in paths if path != "compensation")
    return (Column("compensation", "Compensation"), *others)


def margin_tables(sweeps: Sequence[Sweep], named: tuple[Column, ...]) -> Iterator[Table]:
    """Bandwidth and margins, and their crossings; `named`: columns of each sweep's place."""
    read = [(sweep, sweep.found) for sweep in sweeps if sweep.found is not None]
    yield _servo_table(named, [_servo_row(sweep, servo) for sweep, servo in read])
    yield Table(
        key="crossovers",
        title="Crossover frequencies of the margins",
        columns=(
            *named,
            Column("gain_crossover", "Gain crossover", "Hz", "Hz"),
            Column("phase_crossover", "Phase crossover", "Hz", "Hz"),
            Column("crossover", "Phase crossover is"),
        ),
        rows=tuple({**sweep.place, **_crossover_row(servo)} for sweep, servo in read),
    )
    yield _all_crossings(named, read)


def _effect_table(named: tuple[Column, ...], sweeps: list[Sweep]) -> Iterator[Table]:
    rows = [
        {**{c.name: sweep.place.get(c.name) for c in named}, **_changes(bare, sweep)}
        for bare, sweep in _pairs(sweeps)
    ]
    if rows:
        yield Table(
            key="compensation-effect",
            title="Effect of compensation",
            columns=(
                *named,
                *(Column(name, f"{label}, change", u, d) for name, label, u, d in QUANTITIES),
            ),
            rows=tuple(rows),
            note="Against the same loop without compensation. Where one of the two is only a "
            "bound, their difference is not known.",
        )


ONE_SIGMA = Cause(
    "standard error from noise",
    "it is the standard error of the column before it, from noise alone",
)


def _servo_table(named: tuple[Column, ...], rows: list[Mapping[str, Cell]]) -> Table:
    return Table(
        key="servo-characteristics",
        title="Bandwidth and stability margins from the measured response",
        columns=(
            *named,
            *(column for quantity in QUANTITIES for column in _with_error(*quantity)),
            Column("gain_margin_bound", "Gain margin at least", "dB"),
        ),
        rows=tuple(rows),
        thesis=("5.3", "5.9"),
        note="Bandwidth is where the gain of the closed loop falls to -3 dB of unity, which its "
        "integral action gives it at zero frequency. Margins are of the open loop T / (1 - T). "
        "Intervals include noise and interpolation between the frequencies, not the friction's "
        "changes from day to day. A gain margin beyond the sweep is the hull of several fits of an "
        "integrator with a delay; what it is at least assumes only that the gain rises no more.",
    )


def _with_error(name: str, label: str, unit: str, display: str) -> Iterator[Column]:
    """Columns of a quantity and of its standard error."""
    yield Column(name, label, unit, display)
    name, label = f"{name}_standard_error", "± (1σ)"
    yield Column(name, label, unit, display, reason=ONE_SIGMA(), file_only=True)


def _servo_row(sweep: Sweep, found: ServoCharacteristics) -> dict[str, Cell]:
    values = _values(found)
    errors = {f"{name}_standard_error": value.standard_error for name, value in values.items()}
    return {**sweep.place, **values, **errors, "gain_margin_bound": found.gain_margin_bound}


def _crossover_row(found: ServoCharacteristics) -> dict[str, Cell]:
    phase, gain = found.crossing(found.phase_margin), found.crossing(found.gain_margin)
    return {
        "gain_crossover": phase.frequency if phase else None,
        "phase_crossover": gain.frequency if gain else None,
        "crossover": _read(gain),
    }


def _read(crossing: Crossing | None) -> str | None:
    if crossing is None:
        return None
    return "extrapolated" if crossing.extrapolated else "measured"


def _all_crossings(
    named: tuple[Column, ...], read: list[tuple[Sweep, ServoCharacteristics]]
) -> Table:
    rows: list[Mapping[str, Cell]] = [
        {
            **sweep.place,
            "level": each.level,
            "frequency": each.frequency,
            "gain_margin": each.margin if each.level == "-180 deg" else None,
            "phase_margin": each.margin if each.level == "0 dB" else None,
            "crossing": _read(each),
        }
        for sweep, servo in read
        for each in servo.crossings
    ]
    return Table(
        key="all-crossings",
        title="All crossings that exceed noise",
        columns=(
            *named,
            Column("level", "Crosses"),
            Column("frequency", "Frequency", "Hz", "Hz"),
            Column("gain_margin", "Gain margin there", "dB"),
            Column("phase_margin", "Phase margin there", "rad", "deg"),
            Column("crossing", "Crossing is"),
        ),
        rows=tuple(rows),
        note="-3 dB of the closed loop; 0 dB, and -180° above it, of the open loop.",
    )


def closed_notes(sweeps: list[Sweep]) -> Iterator[str]:
    """Notes on quantities that the sweep does not determine."""
    for sweep in sweeps:
        servo, highest = sweep.found, sweep.response.frequency[-1]
        if servo is None:
            continue
        yield from _slow_note(sweep)
        gain = servo.crossing(servo.gain_margin)
        width = servo.bandwidth
        if width.kind == "number" and math.isnan(width.value):
            yield f"With {sweep.label} there is no bandwidth: {width.reason}."
        elif width.kind != "number":
            yield f"With {sweep.label} the gain does not fall through -3 dB within the sweep."
        if math.isnan(servo.phase_margin.value):
            yield f"With {sweep.label} the open loop does not cross 0 dB in or near the sweep."
        elif math.isnan(servo.gain_margin.value):
            yield f"With {sweep.label} the phase does not cross -180° in or near the sweep."
        elif servo.gain_margin.kind == "at least":
            yield (
                f"With {sweep.label} the phase does not surely cross -180° within the sweep's "
                f"{highest:.4g} Hz: the gain margin is a bound ({servo.gain_margin.method})."
            )
        elif gain is not None and gain.extrapolated:
            yield (
                f"With {sweep.label} the phase crosses -180° near {gain.frequency.value:.3g} Hz, "
                f"above the sweep's {highest:.4g} Hz: the gain margin is extrapolated. Its "
                "interval is the hull of several fits. A sweep beyond the crossing measures it to "
                "0.1 dB."
            )


def _slow_note(sweep: Sweep) -> Iterator[str]:
    """Note on a loop that does not follow its slowest command: its unit or a sign may be wrong."""
    response = sweep.response
    lowest, level = float(response.frequency[0]), float(response.level[0])
    phase, unsure = float(response.phase[0]), float(response.relative_error[0])
    gain_off = abs(level) > FOLLOWS + SURELY * DECIBEL * unsure
    turned = abs(phase) > 0.5 * math.pi + SURELY * unsure
    if not gain_off and not turned:
        return
    check = [
        *(["the units of command and rate"] if gain_off else []),
        *(["the signs of both"] if turned else []),
    ]
    yield (
        f"With {sweep.label} the response at the lowest frequency, {lowest:.4g} Hz, has "
        f"{level:.3g} dB and {math.degrees(phase):.3g}°. A loop follows slow commands at about "
        f"0 dB and 0°: unless the sweep begins above its bandwidth, check {' and '.join(check)}."
    )


FOLLOWS = 20.0 * math.log10(2.0)
"""Largest error of the gain at the lowest frequency without a note (dB)."""
SURELY = 3.0
"""Standard deviations beyond `FOLLOWS`."""


def quality_note(sweeps: list[Sweep]) -> Iterator[str]:
    """Notes on the linearity of the response."""
    for sweep in sweeps:
        coherence = sweep.response.coherence
        worst = int(np.argmin(coherence))
        yield (
            f"{sweep.label[0].upper()}{sweep.label[1:]}, {sweep.loop} loop: at least "
            f"{100 * coherence[worst]:.3g} % of the response's power is at the excitation "
            f"frequency (least at {sweep.response.frequency[worst]:.4g} Hz); the rest is noise and "
            "harmonics that friction makes."
        )


def modes(
    sweeps: list[Sweep], paths: list[str]
) -> tuple[Table, tuple[Finding, ...], tuple[str, ...]]:
    """Elastic modes of open loops: a table, findings, and notes on loops without a mode."""
    rows: list[Mapping[str, Cell]] = []
    findings: list[Finding] = []
    notes: list[str] = []
    for sweep in sweeps:
        mode = elastic_mode(sweep.response)
        row: dict[str, Cell] = {**sweep.place}
        if mode is None:
            notes.append(f"With {sweep.label} the open loop shows no elastic mode in the sweep.")
        else:
            row |= {
                "frequency": mode.frequency,
                "antiresonance": mode.antiresonance,
                "damping_ratio": mode.damping_ratio,
            }
            findings.append(Finding.of(mode.frequency, sweep.place))
        rows.append(row)
    table = Table(
        key="elastic-mode",
        title="First elastic mode in the torque-to-rate response",
        columns=(
            *_place_columns(paths),
            Column("frequency", "Resonance", "Hz", "Hz"),
            Column("antiresonance", "Antiresonance", "Hz", "Hz"),
            Column("damping_ratio", "Damping ratio"),
        ),
        rows=tuple(rows),
        note="A resonance and an antiresonance fitted on top of a smooth response; intervals from "
        "what the fit leaves over.",
    )
    return table, tuple(findings), tuple(notes)


def falling_amplitude(group: Sequence[TrialData]) -> Iterator[str]:
    """Note if limits reduced the amplitude of a rate command along the sweep."""
    sines = [i.trial.task.command for i in group if i.trial.task.mode == "rate"]
    full = [s for s in sines if isinstance(s, Sine)]
    if not full:
        return
    largest = max(sine.amplitude for sine in full)
    lowered = [sine for sine in full if sine.amplitude < largest * (1 - 1e-9)]
    if lowered:
        first = min(lowered, key=lambda sine: sine.frequency)
        least = max(lowered, key=lambda sine: sine.frequency)
        yield (
            f"The command's amplitude was {rate_text(largest)} below "
            f"{first.frequency:.4g} Hz; from there on its acceleration was kept, down to "
            f"{rate_text(least.amplitude)} at {least.frequency:.4g} Hz. Where friction "
            "matters, other amplitudes give other responses."
        )
