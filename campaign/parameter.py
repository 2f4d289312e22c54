"""Parameters: identified numbers of a rig, and their basis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from campaign.estimate import Estimate, Origin
from campaign.reason import NONE, Cause, Reason

MOST_LEFT = 1.0 / 3.0
"""RMS of a validation's residual, over that of what was measured, up to which a model predicts it:
a ninth of the power. What it lacks beyond that is no small correction, as friction is not."""
UNPREDICTED = Cause(
    "validation residual",
    "validation residual (RMS): {percent:.2g} % of the measured {what}; the model does not predict "
    "this motion",
)


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
class IdentifiedRig:
    """What an analysis identifies of a rig, beside its tables, figures and findings.

    Attributes:
        parameters: of the model that it chose; empty where it identifies none.
        correlations: of parameters, by their names; pairs that are not named go their own ways.
        settings: further values that the bench file needs for these parameters to be of use, by
            key: value, SI unit (rotary; "" for none) and what they rest on; nobody measured them.
        again: options that fit the same model to other data, by name.
        unseen: how the model does on the validation; None without any.
        left_out: of the recordings, one reason for each kind.
    """

    parameters: tuple[Parameter, ...] = ()
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


NOTHING_IDENTIFIED = IdentifiedRig()
