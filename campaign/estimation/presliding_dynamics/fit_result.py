"""Result of a joint fit below breakaway: simulation, residuals, derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.presliding_dynamics.channel import Channel
from campaign.estimation.presliding_dynamics.parameters import LARGEST_OFFSET, Parameters
from campaign.estimation.presliding_dynamics.plant import Plant
from campaign.estimation.presliding_dynamics.record import Record, measured
from campaign.estimation.presliding_dynamics.simulation import (
    Motion,
    simulate,
    steps_per_sample,
    torque_on_grid,
)

DIFFERENCE = 1e-6
"""Difference for the Jacobian, in the vector's units."""
DELAYS = (("rate_delay",), ("angle_delay",))
"""Parameters that change only the samples of a motion, not the motion."""


@dataclass(frozen=True)
class Grid:
    """Torque input of the simulation of a record.

    Attributes:
        torque: at beginning, middle and end of each step, shape (steps, 3) (N m).
        per_sample: steps per sample.
    """

    torque: Array
    per_sample: int

    @classmethod
    def of(cls, record: Record, plant: Plant) -> Grid:
        """Grid with steps fine enough for a plant."""
        count = steps_per_sample(plant, record.step, record.highest_frequency())
        return cls(torque_on_grid(record.torque, count), count)


@dataclass(frozen=True)
class JointFit:
    """A joint fit.

    Attributes:
        records: the fitted records.
        parameters: layout of the vector.
        vector: minimum of the sum of squares.
        channels: of each record.
        grids: torque of each record, on its grid.
        doubt_answers: response of the channels of each record to the error columns of its torque,
            shape (channels, n, m).
        taken: factors of these columns that `grids` already include, shape (m,).
        residuals: of each record: measured less simulated, without offset and drift, in
            deviations, shape (channels, n).
        jacobians: of each record: derivatives of the simulated samples by the vector, likewise,
            shape (channels, n, size).
        priors: derivatives of the prior terms, mainly of the records' own parameters, (size,).
        cost: sum of squares, priors included.
        reached: whether the search ended at a minimum.
    """

    records: tuple[Record, ...]
    parameters: Parameters
    vector: Array
    channels: tuple[tuple[Channel, ...], ...]
    grids: tuple[Grid, ...]
    doubt_answers: tuple[Array, ...]
    taken: Array
    residuals: tuple[Array, ...]
    jacobians: tuple[Array, ...]
    priors: Array
    cost: float
    reached: bool

    @property
    def plant(self) -> Plant:
        """Plant of the best fit."""
        return self.parameters.plant(self.vector)

    def motion(self, number: int) -> Motion:
        """Simulated motion of a record."""
        return _motion(self, number, self.vector)

    def answers(self, number: int, plant: Plant | None = None) -> Array:
        """Simulated samples of a record's channels, shape (channels, n)."""
        return _answers(self, number, self.vector, plant)

    @property
    def information(self) -> Array:
        """Information of all parameters, with the priors, shape (size, size)."""
        total = np.diag(self.priors**2)
        for slopes in self.jacobians:
            total = total + products(slopes, slopes)
        return total

    def largest_yielding(self, number: int) -> float:
        """Largest bristle torque of a record over the fitted slip torque of the bristles."""
        bent = self.motion(number).bristle_torque[:, 0]
        return float(np.max(np.abs(bent))) * abs(self.plant.bristles[0].compliance)


def products(one: Array, other: Array) -> Array:
    """Sums over channels and samples of columns (channels, n, k) and (channels, n, m), (k, m)."""
    return np.asarray(one.reshape(-1, one.shape[-1]).T @ other.reshape(-1, other.shape[-1]))


def with_slopes(fit: JointFit) -> JointFit:
    """The fit with its derivatives."""
    every = range(len(fit.records))
    return replace(fit, jacobians=tuple(slopes_of(fit, number, fit.vector) for number in every))


def with_doubts(fit: JointFit) -> JointFit:
    """Add the torque of the best fit and the plant's response to errors of the torque.

    These errors are small; the response to them is linear.
    """
    fit, responses = centred(fit), []
    for number, record in enumerate(fit.records):
        base = _answers(fit, number, fit.vector)
        answers = np.zeros((*base.shape, record.doubts.shape[1]))
        for index, column in enumerate(record.doubts.T):
            pushed = with_torque(
                fit, number, fit.grids[number].torque + _on_grid(fit, number, column)
            )
            answers[:, :, index] = _answers(pushed, number, fit.vector) - base
        responses.append(answers)
    return replace(fit, doubt_answers=tuple(responses))


def centred(fit: JointFit) -> JointFit:
    """Set the torque of the best fit, which is also the input of other plants."""
    factors = fit.vector[fit.parameters.doubted]
    moved = replace(fit, taken=factors)
    for number, record in enumerate(fit.records):
        more = _on_grid(fit, number, record.doubts @ (factors - fit.taken))
        moved = with_torque(moved, number, fit.grids[number].torque + more)
    return moved


def _on_grid(fit: JointFit, number: int, torque: Array) -> Array:
    return torque_on_grid(torque, fit.grids[number].per_sample)


def with_torque(fit: JointFit, number: int, torque: Array) -> JointFit:
    """Set the torque on the grid of a record, shape (steps, 3)."""
    grids = list(fit.grids)
    grids[number] = replace(grids[number], torque=torque)
    return replace(fit, grids=tuple(grids))


def _motion(fit: JointFit, number: int, vector: Array, plant: Plant | None = None) -> Motion:
    parameters, record = fit.parameters, fit.records[number]
    grid, own = fit.grids[number], vector[parameters.of_record(number)]
    scale = LARGEST_OFFSET * record.amplitude
    moved = grid.torque + scale * own[0]
    bent, rate = None, 0.0
    if not record.at_rest:
        bent = float(moved[0, 0] + scale * own[1])
        rate = own[2] * scale / parameters.damping_scale
    return simulate(
        plant or parameters.plant(vector),
        moved,
        record.step,
        per_sample=grid.per_sample,
        bristle_torque=bent,
        rate=rate,
    )


def _answers(fit: JointFit, number: int, vector: Array, plant: Plant | None = None) -> Array:
    return _seen(fit, number, _motion(fit, number, vector, plant), vector)


def _seen(fit: JointFit, number: int, motion: Motion, vector: Array) -> Array:
    """Samples of a motion in the channels of a record, shape (channels, n)."""
    seen = []
    for channel in fit.channels[number]:
        at = motion.rate_at if channel.name == "rate" else motion.angle_at
        seen.append(at(fit.parameters.delay(vector, channel.name)))
    return np.array(seen) + fit.doubt_answers[number] @ (vector[fit.parameters.doubted] - fit.taken)


def residuals_of(fit: JointFit, number: int, vector: Array) -> Array:
    """Measured less simulated, without offset and drift, in deviations, shape (channels, n)."""
    answers = _answers(fit, number, vector)
    pairs = zip(fit.channels[number], answers, strict=True)
    return np.array([channel.left(channel.samples - answer) for channel, answer in pairs])


def slopes_of(fit: JointFit, number: int, vector: Array) -> Array:
    """Jacobian of the simulated samples, in deviations, (channels, n, size), by differences."""
    parameters, channels = fit.parameters, fit.channels[number]
    own = parameters.of_record(number)
    base = _motion(fit, number, vector)
    answers = _seen(fit, number, base, vector)
    slopes = np.zeros((len(channels), len(fit.records[number].torque), len(vector)))
    doubts = zip(channels, fit.doubt_answers[number], strict=True)
    slopes[:, :, parameters.doubted] = [c.left(each) for c, each in doubts]
    for index in (*range(len(parameters.names)), *range(own.start, own.stop)):
        moved = vector.copy()
        moved[index] += DIFFERENCE
        delay = parameters.names[index : index + 1] in DELAYS
        motion = base if delay else _motion(fit, number, moved)
        slope = (_seen(fit, number, motion, moved) - answers) / DIFFERENCE
        slopes[:, :, index] = [c.left(each) for c, each in zip(channels, slope, strict=True)]
    return slopes


def unexplained(fit: JointFit, record: Record) -> float:
    """Rms residual of another record with the fitted plant, over the rms of its motion.

    Both are of its first channel, without offset and drift. No other parameter is fitted.
    """
    grid = Grid.of(record, fit.plant)
    channels = tuple(
        Channel.of(name, samples, valid, 1.0, np.ones(1))
        for name, samples, valid in measured(record)
    )
    own = 1 if record.at_rest else 3
    shared = fit.vector[: len(fit.parameters.names)]
    other = replace(
        fit,
        records=(record,),
        parameters=replace(fit.parameters, factors=0, own=(own,)),
        vector=np.append(shared, np.zeros(own)),
        channels=(channels,),
        grids=(grid,),
        taken=np.zeros(0),
        doubt_answers=(np.zeros((len(channels), len(record.torque), 0)),),
    )
    first, answer = channels[0], other.answers(0)[0]
    residual = first.left(first.samples - answer)
    return float(np.linalg.norm(residual) / np.linalg.norm(first.left(first.samples)))
