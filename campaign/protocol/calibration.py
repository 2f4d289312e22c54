"""The `[calibration]` table of a protocol."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, StrictFloat, StrictInt, StrictStr, model_validator

from campaign.options import Options, spelled
from campaign.protocol.files import Origin, Source
from campaign.units import Time

Number = StrictStr | StrictFloat | StrictInt
"""Text with a unit, or a bare number for a value without a unit."""


class CalibrationParameter(Options):
    """One `[[calibration.parameter]]`: an unknown of the bench."""

    name: Annotated[
        str,
        Field(max_length=60),
        spelled(r"[A-Za-z][A-Za-z0-9_-]*", "a letter, then letters, digits, - and _"),
    ]
    """Name in the result."""
    path: str = ""
    """Field of the bench, e.g. axis.inertia."""
    paths: tuple[str, ...] = ()
    """Instead of `path`: several fields that it sets together."""
    factors: tuple[float, ...] = ()
    """Factor of each of `paths`; 1 when absent."""
    lower: Number
    """Smallest value, with its unit."""
    upper: Number
    """Largest value, with its unit."""
    scale: Literal["log", "linear"] = "linear"
    """Scale with even steps and random starts: the logarithm of the value, or the value."""

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if bool(self.path) == bool(self.paths):
            raise ValueError("give one of 'path' and 'paths'")
        if self.factors and len(self.factors) != len(self.fields):
            raise ValueError(f"{len(self.factors)} factors for {len(self.fields)} paths")
        if 0.0 in self.factors:
            raise ValueError("a factor of 0 leaves nothing to fit")
        return self

    @property
    def fields(self) -> tuple[str, ...]:
        """All fields it drives."""
        return self.paths or (self.path,)


class CalibrationOptions(Options):
    """`[calibration]`: parameters of a bench, and the published cells to fit them to."""

    bench: str
    """The bench to fit; every test of the protocol uses it."""
    cells: tuple[str, ...] = Field(min_length=1)
    """Cells to fit to: `table`, `table/row` or `table/row/column`; * for any row."""
    without: tuple[str, ...] = ()
    """Cells to omit, in the same form."""
    parameter: tuple[CalibrationParameter, ...] = Field(min_length=1)
    """The unknowns."""
    weights: dict[str, Number] = {}
    """Standard deviation of the cells: "6 %", or in their unit, "0.3 Hz"; the most specific name
    applies."""
    starts: int = Field(default=4, ge=1, le=1000)
    """Number of fits: the first starts from the bench as it is, the others at random."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of the random starts, and of tests without their own seed."""
    max_evaluations: int = Field(default=60, ge=1, le=100_000)
    """Most steps of each fit; steps for derivatives only are not counted."""
    loss: Literal["linear", "soft_l1", "huber", "cauchy", "arctan"] = "soft_l1"
    """Weight of deviations: linear is least squares, the others reduce the effect of outliers."""
    tolerance: float = Field(default=1e-4, gt=0, lt=1)
    """Relative change of cost or parameters below which a fit has converged."""
    difference_step: float = Field(default=0.005, gt=0, le=0.1)
    """Step of the numerical derivatives, as a share of the range from lower to upper."""
    longest_step: Time = Field(default=0.25e-3, gt=0, le=0.01)
    """Longest integration step of the simulation."""
    leave_out: str = "frequency"
    """Condition whose values are omitted one by one, to validate predictions from the others."""
    leave_out_evaluations: int = Field(default=5, ge=1, le=100_000)
    """Most steps of each of these refits; they start at the optimum."""


@dataclass(frozen=True)
class Calibration:
    """The `[calibration]` of a loaded protocol.

    Attributes:
        bench: the source of the fitted bench.
        origin: of the protocol's top level, for later problems.
    """

    options: CalibrationOptions
    bench: Source
    origin: Origin
