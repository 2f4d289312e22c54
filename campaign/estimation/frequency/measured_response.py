"""A measured response with the uncertainty of each point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array, ComplexArray, Flags
from campaign.estimation.frequency_response import Response
from campaign.estimation.intervals import student

ALIKE = 8.0
"""Number of neighbors with a common bias: the factor of its square in the variance of a fit."""
LEAST_FREEDOM = 5.0
"""Least degrees of freedom of a variance that is a weight; more than 4 are necessary."""


@dataclass(frozen=True)
class MeasuredResponse:
    """Output over input at n frequencies.

    Attributes:
        frequency: ascending (Hz), shape (n,).
        values: complex, in the output's unit over the input's, shape (n,).
        variance: E|error|² of each value by scatter, real and imaginary part together, shape (n,).
        freedom: real degrees of freedom of `variance`, shape (n,); infinite if it is exact.
        coherence: share of the output's power that the excitation explains, shape (n,).
        bias: possible error of the method, such as of a window at a sharp mode: size of a complex
            error (1 sigma), shape (n,).
        method: description of the method.
    """

    frequency: Array
    values: ComplexArray
    variance: Array
    freedom: Array
    coherence: Array
    bias: Array
    method: str = ""

    @staticmethod
    def of(response: Response, method: str = "sine by sine") -> MeasuredResponse:
        """Response measured sine by sine; its variances count as exact."""
        n = len(response.frequency)
        return MeasuredResponse(
            response.frequency,
            response.values,
            2.0 * response.error**2,
            np.full(n, np.inf),
            response.coherence,
            np.zeros(n),
            method,
        )

    @property
    def error(self) -> Array:
        """Standard deviation of the real and of the imaginary part, bias included, shape (n,)."""
        return np.asarray(np.sqrt(0.5 * (self.variance + self.bias**2)))

    @property
    def widened(self) -> Array:
        """`error` times Student's t over the normal quantile, for use without `freedom`, (n,)."""
        normal = student(np.inf)
        few = np.array([student(float(each)) for each in self.freedom]) / normal
        return np.asarray(np.sqrt(0.5 * (self.variance * few**2 + self.bias**2)))

    @property
    def response(self) -> Response:
        """As `Response`, with errors widened for few degrees of freedom."""
        return Response(self.frequency, self.values, self.widened, self.coherence)

    def at(self, kept: Flags | NDArray[np.intp] | slice) -> MeasuredResponse:
        """Some points of the response."""
        parts = ("frequency", "values", "variance", "freedom", "coherence", "bias")
        return replace(self, **{name: getattr(self, name)[kept] for name in parts})

    def between(self, lowest: float, highest: float) -> MeasuredResponse:
        """Points from `lowest` to `highest` (Hz)."""
        return self.at((self.frequency >= lowest) & (self.frequency <= highest))

    def times(self, factor: ComplexArray | Array) -> MeasuredResponse:
        """Response times an exact function, shape (n,), such as 2 pi i f from angle to rate."""
        size = np.abs(factor)
        return replace(
            self,
            values=self.values * factor,
            variance=self.variance * size**2,
            bias=self.bias * size,
        )


def closed_from_open(loop: MeasuredResponse) -> MeasuredResponse:
    """T = L / (1 + L) of a measured open loop L with unit feedback."""
    rest = np.where(np.abs(1.0 + loop.values) > 0, 1.0 + loop.values, 1e-300)
    # dT = dL / (1 + L)².
    closed = loop.times(np.asarray(1.0 / rest**2))
    return replace(closed, values=loop.values / rest)
