"""A run as another laboratory would have recorded it: other names, units, signs, and its own clock.

What this writes is text made here, from samples of a run; nothing of the program's own export or
import takes part in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaign.recording import Recording


@dataclass(frozen=True)
class Foreign:
    """How a channel is written: value in the file = scale * SI value."""

    column: str
    unit: str
    scale: float


DEGREES = {
    "gyro_rate": Foreign("w_gyro [deg/s]", "deg/s", 180 / np.pi),
    "relative_rate": Foreign("enc speed", "rpm", 30 / np.pi),
    "relative_angle": Foreign("enc pos", "deg", 180 / np.pi),
    "drive_torque": Foreign("M_soll", "N cm", -100.0),
    "pointing_error": Foreign("LOS", "mrad", 1e3),
    "command": Foreign("Sollwert", "deg/s", 180 / np.pi),
}


def written(
    path: Path,
    recording: Recording,
    columns: Mapping[str, Foreign],
    *,
    jitter: float = 0.0,
    seed: int = 1,
    separator: str = ";",
    decimal: str = ",",
) -> None:
    """A recording as text: times in ms, off by up to `jitter` of a sample, shifted by 12.5 s."""
    step = float(recording.time[1] - recording.time[0])
    rng = np.random.default_rng(seed)
    time = recording.time + 12.5
    off = rng.uniform(-jitter, jitter, len(time)) * step
    stamped = time + off
    names = ["t/ms", *(each.column for each in columns.values())]
    rows = [stamped * 1e3]
    for name, each in columns.items():
        values = recording[name]
        if jitter > 0.25:  # it was sampled when the stamp says
            values = np.interp(stamped, time, values)
        rows.append(values * each.scale)
    with path.open("w", encoding="cp1252") as file:
        file.write(separator.join(names) + "\n")
        for row in zip(*rows, strict=True):
            file.write(separator.join(f"{v:.9g}".replace(".", decimal) for v in row) + "\n")


def columns_toml(columns: Mapping[str, Foreign], *, repair: str = "") -> str:
    """The layout of such files, in a mapping."""
    lines = ["[columns.rig.time]", 'column = "t/ms"', 'unit = "ms"']
    if repair:
        lines.append(f'repair = ["{repair}"]')
    for name, each in columns.items():
        lines += [f"[columns.rig.{name}]", f'column = "{each.column}"', f'unit = "{each.unit}"']
        if each.scale < 0:
            lines.append("sign = -1")
    return "\n".join(lines)
