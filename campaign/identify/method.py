"""What a method of identification is: which trials suffice, and what it makes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from campaign.archive import ArchivedTrial
from campaign.estimate import Estimate, Origin
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.reason import NONE, Cause, Reason
from campaign.result import Result

MOST_LEFT = 1.0 / 3.0
"""RMS of a validation's residual, over that of what was measured, up to which a model predicts it:
a ninth of the power. What it lacks beyond that is no small correction, as friction is not."""
UNPREDICTED = Cause(
    "validation residual",
    "validation residual (RMS): {percent:.2g} % of the measured {what}; the model does not predict "
    "this motion",
)


def no_progress(text: str) -> None:
    """Where nobody waits."""


def say_at(say: Callable[[str], None], step: str, text: str) -> None:
    """Tell what is being done at a step of several, e.g. `method 2 of 5`."""
    say(f"{step}, {text}")


@dataclass(frozen=True)
class Material:
    """What is identified from.

    Attributes:
        bench: what is stated of the rig.
        trials: that models are fitted to, completed measurements in plan order.
        validation: that no model is fitted to, and that predictions are held against; read once,
            when everything is chosen. Empty without any.
        say: tells whoever waits what is being done.
    """

    bench: Bench
    trials: tuple[ArchivedTrial, ...]
    validation: tuple[ArchivedTrial, ...] = ()
    say: Callable[[str], None] = no_progress


def is_value(estimate: Estimate) -> bool:
    """Whether a bench file may state it: a measured number with its interval, and no bound."""
    measured = estimate.origin is Origin.MEASURED and estimate.has_interval
    return measured and estimate.kind == "number"


@dataclass(frozen=True)
class Parameter:
    """A number of the rig.

    Attributes:
        estimate: SI, of a rotary axis; what is shown follows from the bench.
        meaning: one sentence.
        display: unit that a reader is shown, "" for the same.
        bench: key of the bench file that it fills in, e.g. `axis.inertia`; "" for none, which it
            always is of what is no measured number: not determined, or a bound.
        lumped: key of a friction model that stands for all interfaces together, as that of a
            compensation does, e.g. `negative.coulomb_torque`; "" for none.
        advice: what to measure next to make its interval narrower; "" where nobody knows.
    """

    estimate: Estimate
    meaning: str
    display: str = ""
    bench: str = ""
    advice: str = ""
    lumped: str = ""

    def __post_init__(self) -> None:
        if not is_value(self.estimate):
            object.__setattr__(self, "bench", "")


@dataclass(frozen=True)
class Unseen:
    """What a model leaves over of a validation.

    Attributes:
        share: RMS of the residual over that of what was measured.
        what: which was measured: `torque`, `motion`.
    """

    share: float
    what: str = "torque"

    @property
    def warning(self) -> Reason:
        """None where the model predicts it."""
        if self.share <= MOST_LEFT:  # NaN predicts nothing
            return NONE
        return UNPREDICTED(percent=100.0 * self.share, what=self.what)


@dataclass(frozen=True)
class Identified:
    """What one method found.

    Attributes:
        parameters: of the model that it settled on.
        result: tables, figures, findings, notes and conclusions behind them.
        correlations: of parameters, by their names; pairs that are not named go their own ways.
        settings: further values that the bench file needs for these parameters to be of use, by
            key: value, SI unit (rotary; "" for none) and what they rest on; nobody measured them.
        again: options that fit the same model to other data, by name.
        unseen: how the model does on the validation; None without any.
        left_out: of the recordings, one reason for each kind.
    """

    parameters: tuple[Parameter, ...]
    result: Result
    correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)
    settings: Mapping[str, tuple[Any, str, str]] = field(default_factory=dict)
    again: Mapping[str, Any] = field(default_factory=dict)
    unseen: Unseen | None = None
    left_out: tuple[Reason, ...] = ()

    @property
    def warnings(self) -> tuple[Reason, ...]:
        """What a reader has to know before any number."""
        told = (*self.left_out, self.unseen.warning if self.unseen else NONE)
        return tuple(each for each in told if each)


@dataclass(frozen=True)
class Method:
    """A method of identification.

    Attributes:
        name: what `--model` says.
        summary: one line for `campaign kinds`.
        options: what it accepts; `--set NAME.option=value`.
        suits: of trials, those that it can use; where none, why.
        identify: what they come to. Raises ValueError with a message for the user.
    """

    name: str
    summary: str
    options: type[Options]
    suits: Callable[[Sequence[ArchivedTrial]], tuple[Sequence[ArchivedTrial], str]]
    identify: Callable[[Material, Any], Identified]
