"""Parameters: identified numbers of a rig, and their basis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from campaign.estimate import Estimate, Origin
from campaign.reason import NONE, Cause, Reason

MOST_LEFT = 1.0 / 3.0
"""Maximum ratio of RMS of the validation residual to RMS of the measured signal for a predictive
model: a ninth of the power. A larger residual is no small correction, as friction is not."""
UNPREDICTED = Cause(
    "validation residual",
    "validation residual (RMS): {percent:.2g} % of the measured {what}; the model does not predict "
    "this motion",
)


def is_value(estimate: Estimate) -> bool:
    """Whether a bench file may state it: a measured number with interval, no bound."""
    measured = estimate.origin is Origin.MEASURED and estimate.has_interval
    return measured and estimate.kind == "number"


@dataclass(frozen=True)
class Parameter:
    """A number of the rig.

    Attributes:
        estimate: SI, of a rotary axis; displayed terms depend on the bench.
        meaning: one sentence.
        display: display unit, "" for the same.
        bench: key of the bench file for this value, e.g. `axis.inertia`; "" for none. It is always
            "" if the estimate is no measured number: not determined, or a bound.
        lumped: key of a friction model that combines all interfaces, e.g. of a compensation:
            `negative.coulomb_torque`; "" for none.
        advice: next measurement to reduce its interval; "" if unknown.
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
    """Residual of a model in a validation.

    Attributes:
        share: RMS of the residual divided by RMS of the measured signal.
        what: the measured signal: `torque`, `motion`.
    """

    share: float
    what: str = "torque"

    @property
    def warning(self) -> Reason:
        """Warning if the model does not predict the signal; else NONE."""
        if self.share <= MOST_LEFT:  # false for NaN
            return NONE
        return UNPREDICTED(percent=100.0 * self.share, what=self.what)


@dataclass(frozen=True)
class IdentifiedRig:
    """Identified parameters of a rig, in addition to tables, figures and findings.

    Attributes:
        parameters: parameters of the selected model; may be empty.
        correlations: correlations of parameters by pair of names; missing pairs are uncorrelated.
        settings: further values that the bench file needs to use these parameters, by key: value,
            SI unit (rotary; "" for none) and basis; they are not measured.
        again: options that fit the same model to other data, by name.
        unseen: residual of the validation; None without a validation.
        left_out: reasons for excluded recordings, one for each kind.
    """

    parameters: tuple[Parameter, ...] = ()
    correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)
    settings: Mapping[str, tuple[Any, str, str]] = field(default_factory=dict)
    again: Mapping[str, Any] = field(default_factory=dict)
    unseen: Unseen | None = None
    left_out: tuple[Reason, ...] = ()

    @property
    def warnings(self) -> tuple[Reason, ...]:
        """Warnings that precede all numbers."""
        reasons = (*self.left_out, self.unseen.warning if self.unseen else NONE)
        return tuple(each for each in reasons if each)


NOTHING_IDENTIFIED = IdentifiedRig()
