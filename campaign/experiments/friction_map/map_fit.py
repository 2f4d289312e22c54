"""Points of a map in an unplanned recording with steady sliding."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Window
from campaign.estimation.steady_stretches import steady_stretches
from campaign.experiments.friction_map.runs import DIRECTIONS, SMALLEST_WINDOW, WHOLE
from campaign.physics.bench import Bench
from campaign.trial import OfferedRecording, Task, TrialRequest


def stretches_found(
    options: Any, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """A trial for each steady stretch, of one direction; or the windows that somebody has named.

    Raises ValueError where there is none.
    """
    if offered.windows:
        yield from _named(offered)
        return
    recording = offered.read([GYRO_RATE, DRIVE_TORQUE])
    torque = recording[DRIVE_TORQUE]
    found = [
        each
        for each in steady_stretches(recording[GYRO_RATE], offered.sample_rate, torque)
        if each.stop - each.first >= SMALLEST_WINDOW
    ]
    if not found:
        raise ValueError("nowhere does the load slide steadily; say its windows, or how fast it is")
    for stretch in found:
        start, stop = stretch.first / offered.sample_rate, stretch.stop / offered.sample_rate
        name = "positive" if stretch.rate > 0 else "negative"
        yield _request(
            abs(stretch.rate),
            (Window(name, 0.0, stop - start), Window(WHOLE.format(name), 0.0, stop - start)),
            (start, stop),
        )


def _named(offered: OfferedRecording) -> Iterator[TrialRequest]:
    wrong = [window.name for window in offered.windows if window.name not in DIRECTIONS]
    if wrong:
        raise ValueError(
            f"a window {wrong[0]!r} says nothing here; they are {', '.join(DIRECTIONS)}"
        )
    rate = offered.read([GYRO_RATE])
    speeds = [
        abs(float(rate.window(window.start, window.stop)[GYRO_RATE].mean()))
        for window in offered.windows
    ]
    wholes = tuple(Window(WHOLE.format(w.name), w.start, w.stop) for w in offered.windows)
    speed = offered.conditions.get("speed", sum(speeds) / len(speeds))
    yield _request(float(str(speed)), (*offered.windows, *wholes), (0.0, offered.duration))


def _request(speed: float, windows: tuple[Window, ...], part: tuple[float, float]) -> TrialRequest:
    return TrialRequest(
        Task(
            mode="recorded",
            duration=part[1] - part[0],
            window=(windows[0].start, windows[0].stop),
            sample_rate=1.0,  # the recording's own, once it is known which part of it this is
        ),
        point={"speed": speed},
        note="found in the recording",
        windows=windows,
        part=part,
    )
