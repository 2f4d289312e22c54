"""Conclusions on recorded motions: friction of each direction, tracking."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.experiments.friction_map.conclusions import sliding_conclusions
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.motion.account import Motion, is_surely_something
from campaign.experiments.shared.conclusion_parts import (
    Part,
    conclusion,
    count,
    determined,
    listed,
    ratio_of,
)
from campaign.result import Amount, Conclusion, Factor

TOLD = 4
"""recordings that are told one by one."""


def motion_conclusions(motions: Sequence[Motion]) -> tuple[Conclusion, ...]:
    """Of each recording, the first few."""
    told = [each for motion in motions[:TOLD] for each in _of_one(motion, len(motions) > 1)]
    if len(motions) > TOLD:
        told.append(conclusion(f"{len(motions) - TOLD} more recordings are in the table"))
    return tuple(told)


def _named(motion: Motion) -> str:
    """`trial 2 (joint = 2, joints.csv)`: by what was set, and by its file."""
    told = [f"{name} = {value}" for name, value in motion.place.items()]
    files = motion.data.trial.recording.get("files")
    if isinstance(files, list):
        told += [str(each["name"]) for each in files if isinstance(each, dict)]
    where = f" ({', '.join(told)})" if told else ""
    return f"trial {motion.data.trial.number}{where}"


def _of_one(motion: Motion, several: bool) -> Iterator[Conclusion]:
    who = f"{_named(motion)}: " if several else ""
    yield from sliding_conclusions(motion.sliding.found, who)
    if motion.coefficient is not None:
        yield conclusion(
            f"{who}friction over normal load is ",
            Amount(motion.coefficient),
            f", over {count(len(motion.sliding.points), 'steady stretch', 'steady stretches')}",
        )
    if len(motion.coulomb) == 2:
        positive, negative = (motion.sliding.found[way] for way in DIRECTIONS)
        compared: list[tuple[Part, ...]] = []
        for name, quantity in (
            ("Coulomb friction ", "coulomb_torque"),
            ("viscous friction ", "viscous_friction"),
        ):
            one, other = negative[quantity], positive[quantity]
            if determined(one) and determined(other) and min(one.value, other.value) > 0:
                compared.append((name, Factor(ratio_of(one, other, of_same_trials=True))))
        constant = motion.constant
        if constant is not None and is_surely_something(constant):
            yield conclusion(
                f"{who}half of what they differ by at standstill is ",
                Amount(constant, "N m"),
                ": a load that acts on the axis, or friction that differs by direction",
            )
        if compared:
            yield conclusion(
                f"{who}the negative direction against the positive: ", listed(compared, "; ", "; ")
            )
    error = motion.found.get("rms_error")
    if error is not None and determined(error):
        peak = motion.found["peak_error"]
        yield conclusion(
            f"{who}the reference is met within ",
            Amount(error, "mrad"),
            " (RMS) and ",
            Amount(peak, "mrad"),
            " at most",
        )
    if not motion.sliding.parameters:
        top = motion.found["top_rate"]
        yield conclusion(
            f"{who}the axis moves at up to ",
            Amount(top, "deg/s"),
            "; friction over rate does not follow from ",
            count(len(motion.sliding.points), "steady stretch", "steady stretches"),
        )
