"""What measured responses say, as tables and findings: servo characteristics and elastic modes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from campaign.identification.elastic_mode import elastic_mode
from campaign.identification.frequency_response import Response, ServoCharacteristics
from campaign.result import Column, Finding, Table, Value


@dataclass(frozen=True)
class Sweep:
    """One response of the test: its place in the matrix, and what was found in it."""

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


def _values(found: ServoCharacteristics) -> dict[str, float]:
    return {
        "bandwidth": found.bandwidth,
        "gain_margin": found.gain.margin,
        "phase_margin": found.phase.margin,
    }


def closed_findings(sweep: Sweep) -> Iterator[Finding]:
    """Bandwidth and margins of one closed loop."""
    if sweep.found is not None:
        values = _values(sweep.found)
        for name, _, unit, _ in QUANTITIES:
            yield Finding(name, values[name], unit, sweep.place)


def _pairs(sweeps: list[Sweep]) -> Iterator[tuple[Sweep, Sweep]]:
    """Each compensated sweep and the one without compensation, where all else is equal."""

    def rest(sweep: Sweep) -> dict[str, Value]:
        return {k: v for k, v in sweep.place.items() if k != "compensation"}

    for sweep in sweeps:
        for bare in sweeps:
            if method(bare) == "none" != method(sweep) and rest(bare) == rest(sweep):
                yield bare, sweep


def changes(sweeps: list[Sweep]) -> Iterator[Finding]:
    """What compensation changes in them, in Hz, dB and rad."""
    for bare, sweep in _pairs(sweeps):
        if bare.found is not None and sweep.found is not None:
            before, after = _values(bare.found), _values(sweep.found)
            for name, _, unit, _ in QUANTITIES:
                yield Finding(f"{name}_change", after[name] - before[name], unit, sweep.place)


def closed_tables(sweeps: list[Sweep], paths: list[str]) -> Iterator[Table]:
    """Tables 5.3 and 5.9, where the margins were read, and what compensation changes."""
    extra = [path for path in paths if path != "compensation"]
    rows: list[dict[str, Value]] = []
    for sweep in sweeps:
        found = sweep.found
        if found is None:
            continue
        row: dict[str, Value] = {**sweep.place, **_values(found)}
        row |= {
            "bandwidth_error": found.bandwidth_error,
            "gain_margin_error": found.gain_margin_error,
            "phase_margin_error": found.phase_margin_error,
            "gain_crossover": found.phase.frequency,
            "phase_crossover": found.gain.frequency,
            "crossover": _read(found),
        }
        rows.append({key: _or_none(value) for key, value in row.items()})
    yield Table(
        key="servo-characteristics",
        title="Bandwidth and stability margins from the measured response",
        columns=(
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in extra),
            Column("bandwidth", "Bandwidth", "Hz", "Hz"),
            Column("bandwidth_error", "± (1σ)", "Hz", "Hz"),
            Column("gain_margin", "Gain margin", "dB"),
            Column("gain_margin_error", "± (1σ)", "dB"),
            Column("phase_margin", "Phase margin", "rad", "deg"),
            Column("phase_margin_error", "± (1σ)", "rad", "deg"),
        ),
        rows=tuple(rows),
        thesis=("5.3", "5.9"),
        note="Bandwidth is where the gain of the closed loop falls to -3 dB of unity, which its "
        "integral action gives it at zero frequency. Margins are of the open loop T / (1 - T). "
        "Deviations are those of the noise, not of friction from trial to trial.",
    )
    yield Table(
        key="crossovers",
        title="Where the margins were read",
        columns=(
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in extra),
            Column("gain_crossover", "Gain crossover", "Hz", "Hz"),
            Column("phase_crossover", "Phase crossover", "Hz", "Hz"),
            Column("crossover", "Phase crossover is"),
        ),
        rows=tuple(rows),
    )
    changes = [
        {**{k: sweep.place.get(k) for k in ("compensation", *extra)}, **_difference(bare, sweep)}
        for bare, sweep in _pairs(sweeps)
    ]
    if changes:
        yield Table(
            key="compensation-effect",
            title="What compensation changes",
            columns=(
                Column("compensation", "Compensation"),
                *(Column(path, path) for path in extra),
                *(Column(name, f"{label}, change", u, d) for name, label, u, d in QUANTITIES),
            ),
            rows=tuple(changes),
            note="Against the same loop without compensation.",
        )


def _read(found: ServoCharacteristics) -> str | None:
    if not math.isfinite(found.gain.margin):
        return None
    return "extrapolated" if found.gain.extrapolated else "measured"


def _difference(bare: Sweep, sweep: Sweep) -> dict[str, Value]:
    if bare.found is None or sweep.found is None:
        return {}
    before, after = _values(bare.found), _values(sweep.found)
    return {name: _or_none(after[name] - before[name]) for name in after}


def _or_none(value: Value) -> Value:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def closed_notes(sweeps: list[Sweep]) -> Iterator[str]:
    """What could not be read within the sweep."""
    for sweep in sweeps:
        found, highest = sweep.found, sweep.response.frequency[-1]
        if found is None:
            continue
        if not math.isfinite(found.bandwidth):
            yield f"With {sweep.label} the gain does not fall through -3 dB within the sweep."
        if not math.isfinite(found.phase.margin):
            yield f"With {sweep.label} the open loop does not cross 0 dB in or near the sweep."
        elif not math.isfinite(found.gain.margin):
            yield f"With {sweep.label} the phase does not cross -180° in or near the sweep."
        elif found.gain.extrapolated:
            yield (
                f"With {sweep.label} the phase crosses -180° at {found.gain.frequency:.4g} Hz, "
                f"above the sweep's {highest:.4g} Hz: the gain margin is extrapolated, from an "
                "integrator and a delay fitted to the upper part of the sweep."
            )


def quality_note(sweeps: list[Sweep]) -> Iterator[str]:
    """How far the response is one of a linear system."""
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
    """The elastic modes of open loops: a table, findings, and a sentence where there is none."""
    rows: list[dict[str, Value]] = []
    findings: list[Finding] = []
    notes: list[str] = []
    for sweep in sweeps:
        mode = elastic_mode(sweep.response)
        row: dict[str, Value] = {**sweep.place}
        if mode is None:
            notes.append(f"With {sweep.label} the open loop shows no elastic mode in the sweep.")
        else:
            row |= {
                "frequency": mode.frequency,
                "antiresonance": mode.antiresonance,
                "damping_ratio": mode.damping_ratio,
            }
            findings.append(Finding("elastic_mode_frequency", mode.frequency, "Hz", sweep.place))
        rows.append(row)
    table = Table(
        key="elastic-mode",
        title="First elastic mode in the torque-to-rate response",
        columns=(
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in paths if path != "compensation"),
            Column("frequency", "Resonance", "Hz", "Hz"),
            Column("antiresonance", "Antiresonance", "Hz", "Hz"),
            Column("damping_ratio", "Damping ratio"),
        ),
        rows=tuple(rows),
        note="A resonance and an antiresonance fitted on top of a smooth response.",
    )
    return table, tuple(findings), tuple(notes)
