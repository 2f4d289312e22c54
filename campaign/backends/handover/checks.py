"""Pure checks of returned series against the requested ones.

A recorded command must equal the requested one, sample by sample. A motion is compared only by sign
and size: the tracking of a rig is the subject of the experiment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    JOINT_TORQUE,
    MOTOR_CURRENT,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.recording import Array
from campaign.trial import Task

TOLERANCE = 0.02
"""Largest RMS difference as a share of the command's RMS; beyond it, it is another command."""
HELD = 2
"""Permitted delay of a command in samples: a controller holds its samples."""
AGAINST = -0.3
"""Correlation (about zero) below which a series has the opposite sign."""
ALIKE = 0.9
"""Correlation above which two series have one shape."""
LOUDER = 5.0
"""Factor by which a motion may be larger or smaller than requested: friction takes a part."""
FLAT = 8
"""Minimum number of consecutive samples at an extreme value of a clipped series."""
SHARE = 0.005
"""Minimum share of a recording for these samples."""
LONG = 0.05
"""Minimum share of a recording in which a series is constant while its effect changes."""
CHANGE = 0.1
"""Minimum of that change as a share of the command's RMS."""
LEVELS = 50
"""Minimum number of levels between the extremes for a detection of clipping."""
AT_LIMIT = 0.98
"""Share of a bench's limit from which the limit itself holds a series."""

RATES = (RELATIVE_RATE, GYRO_RATE)
TORQUES = (DRIVE_TORQUE, MOTOR_CURRENT, JOINT_TORQUE)


Shown = Callable[[str, float], str]
"""Formats a value (SI) of a channel, such as `5 deg/s`."""


def plain(channel: str, value: float) -> str:
    """Format of a value without a trial, hence without unit."""
    return f"{value:.6g}"


@dataclass(frozen=True)
class RecordingProblem:
    """A problem of a recording: name and description."""

    name: str
    text: str

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"


def wrong_length(task: Task, samples: int, stopped: bool) -> RecordingProblem | None:
    """Check for an early end; `stopped`: the rate that ends the trial was reached."""
    wanted = task.duration * task.sample_rate
    if stopped or samples >= wanted - 1:
        return None
    had = samples / task.sample_rate
    share = f"{samples / wanted:.0%} of it"
    return RecordingProblem(
        "too short", f"it lasts {had:.6g} s and was asked to last {task.duration:.6g} s ({share})"
    )


def wrong_start(
    task: Task, angle: Array, within: float, shown: Shown = plain
) -> RecordingProblem | None:
    """Check the start angle: `angle` (n,) as recorded, `within` its tolerance."""
    off = float(angle[0]) - task.start_angle
    if abs(off) <= within:
        return None
    return RecordingProblem(
        "another place",
        f"{RELATIVE_ANGLE} begins at {shown(RELATIVE_ANGLE, float(angle[0]))} instead of "
        f"{shown(RELATIVE_ANGLE, task.start_angle)}; 'offset' of its column is for an encoder that "
        "has its zero elsewhere",
    )


def wrong_command(
    got: Array, asked: Array, rate: float, others: Mapping[str, Array], shown: Shown = plain
) -> RecordingProblem | None:
    """Compare a recorded command with the requested one; both (n,), at `rate` (Hz).

    `others`: requested commands of other trials, by name.
    """
    size = _rms(asked)
    if size == 0.0:
        worst = float(np.max(np.abs(got)))
        largest = max((float(np.max(np.abs(o))) for o in others.values()), default=0.0)
        if worst <= TOLERANCE * largest or worst == 0.0:
            return None
        return RecordingProblem(
            "another command", f"nothing was to be commanded, and {shown(COMMAND, worst)} was"
        )
    if _off(got, asked) <= TOLERANCE:
        return None
    if _rms(got) <= TOLERANCE * size:
        return RecordingProblem("no command", "nothing was commanded in all of the recording")
    if (
        _off(-got, asked) <= TOLERANCE
    ):  # before the delay: the negative of a symmetric command resembles a late one
        return RecordingProblem("wrong sign", "the command is the negative of what was asked")
    lag = _lag(asked, got)
    if abs(lag) > HELD and _off(got, asked, lag, lag) <= TOLERANCE:
        word = "late" if lag > 0 else "early"
        shift = f"the command is {word} by {abs(lag) / rate:.4g} s ({abs(lag)} samples)"
        return RecordingProblem(word, f"{shift}; the recording begins with the excitation")
    for name, other in others.items():
        if len(other) == len(asked) and _off(got, other) <= TOLERANCE < _off(asked, other):
            return RecordingProblem("another trial", f"the command is that of {name}")
    scale = float(got @ asked / (asked @ asked))
    if scale != 0.0 and _off(got / scale, asked) <= TOLERANCE:
        what = "wrong sign and scale" if scale < 0 else "wrong scale"
        return RecordingProblem(what, f"the command is {_factor(scale)} times what was asked")
    off = np.abs(got - asked)
    first = int(np.argmax(off > 10 * TOLERANCE * size)) or int(np.argmax(off))
    return RecordingProblem(
        "another command",
        f"the command is {shown(COMMAND, float(got[first]))} instead of "
        f"{shown(COMMAND, float(asked[first]))} at {first / rate:.4g} s, "
        f"and off by {_off(got, asked):.0%} of its size in all",
    )


def wrong_motion(task: Task, series: Mapping[str, Array], asked: Array) -> RecordingProblem | None:
    """Check sign and size of the motion against the command. `series` by channel, (n,)."""
    still = task.base_acceleration.shape == "zero"
    for name in _following(task, still=still):
        if name in series and (problem := _against_command(name, series[name], asked)) is not None:
            return problem
    if RELATIVE_RATE in series and RELATIVE_ANGLE in series:
        angle = series[RELATIVE_ANGLE] - series[RELATIVE_ANGLE][0]
        turned = np.cumsum(series[RELATIVE_RATE]) / task.sample_rate
        if _correlation(angle, turned) < AGAINST and _rms(turned) > 0.1 * _rms(angle):
            return RecordingProblem("wrong sign", f"{RELATIVE_ANGLE} runs against {RELATIVE_RATE}")
    if still and RELATIVE_RATE in series:
        for name in TORQUES[:2]:
            if name in series and _brakes(series[name], series[RELATIVE_RATE]):
                text = f"{name} brakes in both directions what it is to move"
                return RecordingProblem("wrong sign", text)
    return None


def clipped(
    task: Task,
    series: Mapping[str, Array],
    asked: Array,
    limits: Mapping[str, float],
    shown: Shown = plain,
) -> RecordingProblem | None:
    """Detect a torque or current that stays at an extreme value, but should have changed.

    A clipped series differs from a steady one by a sudden end of its slope, or by a change of the
    command or rate error during the constant value.
    `limits` of the bench, by channel: a series at its limit is limited by the bench, not clipped.
    """
    left = asked - series[RELATIVE_RATE] if RELATIVE_RATE in series else None
    left = asked if task.mode == "torque" else left
    for name in TORQUES:
        if name not in series:
            continue
        for sign in (1.0, -1.0):
            values = sign * series[name]
            runs = _runs_at_top(values)
            if not (_cut_off(values, runs) or _of_no_effect(runs, left, len(values), asked)):
                continue
            level, count = series[name][runs[0][0]], sum(end - begin for begin, end in runs)
            if abs(level) >= AT_LIMIT * limits.get(name, np.inf):
                continue
            stays = (
                f"{name} stays at {shown(name, float(level))} for {count} of {len(values)} samples"
            )
            return RecordingProblem("clipped", f"{stays}, while the trial goes on")
    return None


def _following(task: Task, *, still: bool) -> tuple[str, ...]:
    """The channels that must have the command's sign.

    A rate that follows a sine may legitimately be late by half a period. The rate relative to a
    moving hull is not the commanded one.
    """
    if task.mode == "torque":
        return (DRIVE_TORQUE,) if task.compensation == "none" else ()
    if task.command.shape in ("sine", "multisine"):
        return ()
    return RATES if still else (GYRO_RATE,)


def _against_command(name: str, got: Array, asked: Array) -> RecordingProblem | None:
    if _rms(asked) == 0.0 or _rms(got) == 0.0:
        return None
    alike = _correlation(got, asked)
    if alike < AGAINST:
        return RecordingProblem(
            "wrong sign", f"{name} runs against the command (correlation {alike:.2f})"
        )
    scale = float(got @ asked / (asked @ asked))
    if alike > ALIKE and not 1 / LOUDER <= scale <= LOUDER:
        return RecordingProblem(
            "wrong scale", f"{name} is {_factor(scale)} times what was commanded"
        )
    return None


def _brakes(torque: Array, rate: Array) -> bool:
    """Whether a torque opposes the motion in both directions: friction never drives."""
    fast = 0.2 * float(np.max(np.abs(rate)))
    out, back = rate > fast, rate < -fast
    if not (fast and out.any() and back.any()):
        return False
    size = 0.3 * _rms(torque)
    return bool(np.mean(torque[out]) < -size and np.mean(torque[back]) > size)


def _runs_at_top(values: Array) -> list[tuple[int, int]]:
    """Begin and end of the runs at the maximum; empty if the maximum is no large value."""
    top, span = float(np.max(values)), float(np.ptp(values))
    if span == 0.0 or top < 0.5 * float(np.max(np.abs(values))):
        return []
    at_top = values >= top - 1e-9 * span
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_top, [False]]).astype(int)))
    both = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end) for begin, end in both if begin >= 3 and end - begin >= FLAT]


def _cut_off(values: Array, runs: Sequence[tuple[int, int]]) -> bool:
    """Whether the series rises steeply to its maximum and suddenly stays there."""
    if sum(end - begin for begin, end in runs) < max(1.0, SHARE * len(values)):
        return False
    top, span = float(np.max(values)), float(np.ptp(values))
    steps = np.abs(np.diff(values))
    quantum = float(np.min(steps[steps > 1e-9 * span], initial=span))
    if quantum > span / LEVELS:
        return False
    slopes = [(top - float(values[begin - 3])) / 3 for begin, _ in runs]
    return any(
        slope > 2 * quantum and slope * (end - begin) > 0.05 * span
        for slope, (begin, end) in zip(slopes, runs, strict=True)
    )


def _of_no_effect(
    runs: Sequence[tuple[int, int]], left: Array | None, count: int, asked: Array
) -> bool:
    """Whether `left` (command or rate error) changes during the longest run of constant values."""
    if not runs or left is None:
        return False
    begin, end = max(runs, key=lambda run: run[1] - run[0])
    quarter = (end - begin) // 4
    if end - begin < LONG * count or quarter < 1:
        return False
    change = np.mean(left[end - quarter : end]) - np.mean(left[begin : begin + quarter])
    return bool(abs(change) > CHANGE * _rms(asked))


def _lag(asked: Array, got: Array) -> int:
    """Delay of `got` relative to `asked` (samples) at the largest correlation."""
    size = 1 << (len(asked) + len(got) - 1).bit_length()
    spectrum = np.fft.rfft(got, size) * np.conj(np.fft.rfft(asked, size))
    alike = np.fft.irfft(spectrum, size)
    best = int(np.argmax(alike))
    return best if best < size // 2 else best - size


def _off(got: Array, asked: Array, first: int = -HELD, last: int = HELD) -> float:
    """RMS of the difference divided by the RMS of `asked`, at the best lag from first to last."""
    size = _rms(asked)
    differences = []
    for lag in range(first, last + 1):
        a = asked[max(0, -lag) : len(asked) - max(0, lag)]
        b = got[max(0, lag) : len(got) - max(0, -lag)]
        differences.append(_rms(b - a) / size if len(a) else np.inf)
    return float(min(differences))


def _correlation(a: Array, b: Array) -> float:
    """Correlation about zero; 0 if one series is zero."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


_FACTORS = (("degrees and radians", 180 / np.pi), ("rpm and rad/s", 30 / np.pi), ("milli", 1e3))


def _factor(scale: float) -> str:
    """Text of a factor with its possible cause."""
    for name, value in _FACTORS:
        for known in (value, 1 / value):
            if abs(abs(scale) / known - 1.0) < TOLERANCE:
                return f"{scale:.5g} ({name}?)"
    return f"{scale:.5g}"
