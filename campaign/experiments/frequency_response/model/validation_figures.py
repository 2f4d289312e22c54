"""Tables and figures of a validation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from campaign.estimation.frequency.output_error import Simulated
from campaign.experiments.frequency_response.model.frequency_fit import FrequencyFit
from campaign.experiments.frequency_response.model.tables import FINE
from campaign.experiments.frequency_response.model.validation import Model, Prediction, Validation
from campaign.experiments.responses.figures import FREQUENCY, decibel, gain_label, panels
from campaign.experiments.responses.sources import fitted_part
from campaign.experiments.responses.tables import NAME, SENSOR
from campaign.reason import Cause
from campaign.result import Axis, Column, Curve, Figure, Mark, Panel, Table

TIME = Axis("Time", "s", "s")
SELDOM = math.sqrt(-math.log(0.05))
"""Complex error over its root mean square that chance exceeds once in twenty."""
LAGS = 30
"""Most lags of an autocorrelation."""
MODEL = Column("model", "Model", exact=True)
OF_LINES = Cause("over these lines", "a mean over these lines; their deviations show how it varies")
IN_LAST_COLUMN = Cause("deviation in a column", "the last column has its uncertainty")


def validation_tables(validation: Validation) -> Iterator[Table]:
    """Predictions together and line by line, and errors of simulated outputs."""
    if validation.predictions:
        yield _together(validation.predictions)
        yield _lines(validation.predictions)
    if validation.own or validation.predictions:
        yield _outputs(validation)


def _together(predictions: Sequence[Prediction]) -> Table:
    rows: list[dict[str, Any]] = [
        {
            "source": each.source.name,
            "excitation": each.source.excitation,
            "side": each.model.side,
            "model": each.model.name,
            "fitted": each.model.source.name,
            "lines": len(each.against.measured.frequency),
            "difference": each.against.relative,
            "square": each.against.square if math.isfinite(each.against.square) else None,
            "verdict": each.against.verdict,
        }
        for each in predictions
    ]
    return Table(
        "validation",
        "Unseen responses, predicted",
        (
            NAME,
            Column("excitation", "Excitation", exact=True),
            SENSOR,
            MODEL,
            Column("fitted", "Fitted to", exact=True),
            Column("lines", "Frequencies", exact=True),
            Column("difference", "Difference, rms", "", "percent", reason=OF_LINES()),
            Column("square", "Square over expected", exact=True),
            Column("verdict", "Verdict", exact=True),
        ),
        tuple(rows),
        note="Nothing was fitted to these responses, and models are followed only where they were "
        "fitted. The square is 1 in the mean where the model is right: scatter of the unseen "
        "response and of the fit explain it.",
    )


def _lines(predictions: Sequence[Prediction]) -> Table:
    rows: list[dict[str, Any]] = []
    for each in predictions:
        against = each.against
        turned = np.angle(against.measured.values / against.predicted)
        for k, frequency in enumerate(against.measured.frequency):
            size = against.in_deviations[k]
            rows.append(
                {
                    "source": each.source.name,
                    "side": each.model.side,
                    "model": each.model.name,
                    "frequency": float(frequency),
                    "measured": float(decibel(np.abs(against.measured.values[k]))),
                    "predicted": float(decibel(np.abs(against.predicted[k]))),
                    "phase": float(turned[k]),
                    "deviations": float(size) if math.isfinite(size) else None,
                }
            )
    reason = IN_LAST_COLUMN()
    return Table(
        "validation-lines",
        "Unseen responses, line by line",
        (
            NAME,
            SENSOR,
            MODEL,
            Column("frequency", "Frequency", "Hz", "Hz", exact=True),
            Column("measured", gain_label("Measured"), reason=reason),
            Column("predicted", gain_label("Predicted"), reason=reason),
            Column("phase", "Phase, measured less predicted", "rad", "deg", reason=reason),
            Column("deviations", "Difference over its deviation", exact=True),
        ),
        tuple(rows),
        note="Complex differences over the deviation expected by scatter of measurement and fit. "
        f"Expected: 1 in the mean square, above {SELDOM:.2f} at one line of twenty.",
    )


def _outputs(validation: Validation) -> Table:
    errors = [("fitted", model.source, model, error) for model, error in validation.own]
    errors += [
        ("unseen", each.source, each.model, each.output)
        for each in validation.predictions
        if each.output is not None
    ]
    rows: list[dict[str, Any]] = [
        {
            "data": data,
            "source": source.name,
            "side": model.side,
            "model": model.name,
            "lowest": model.lowest,
            "highest": model.highest,
            "error": error,
        }
        for data, source, model, error in errors
    ]
    return Table(
        "output-error",
        "Output simulated from the recorded torque",
        (
            Column("data", "Recording", exact=True),
            NAME,
            SENSOR,
            MODEL,
            Column("lowest", "From", "Hz", "Hz", exact=True),
            Column("highest", "To", "Hz", "Hz", exact=True),
            Column("error", "Error over the output", "", "percent"),
        ),
        tuple(rows),
        note="Norms over time within the band of the fit, free motions and offset fitted; noise "
        "of the sensor and what friction does beside a linear response are part of it.",
    )


def validation_figures(validation: Validation) -> Iterator[Figure]:
    """Unseen responses with predictions, and unseen outputs over time."""
    sides: dict[tuple[str, str], list[Prediction]] = {}
    for each in validation.predictions:
        sides.setdefault((each.source.name, each.model.side), []).append(each)
    for number, ((name, side), some) in enumerate(sides.items(), start=1):
        yield _response(f"prediction-{number}-{side}", name, side, some)
        simulated = [(each, each.first) for each in some if each.first is not None]
        if simulated:
            yield _over_time(f"output-{number}-{side}", name, side, simulated)


def _response(key: str, name: str, side: str, some: Sequence[Prediction]) -> Figure:
    measured = some[0].source.responses[some[0].model.side]
    lines = []
    for each in some:
        fine = np.geomspace(each.model.lowest, each.model.highest, FINE)
        lines.append((each.model.name, fine, each.model.value(fine)))
    gain, phase = panels(measured, lines)
    own = [
        Curve(
            each.against.measured.frequency, each.against.in_deviations,
            each.model.name, each.model.name, "points",
        )
        for each in some
        if not each.against.reason
    ]  # fmt: skip
    left = Panel(
        FREQUENCY,
        Axis("Difference over its deviation"),
        own,
        marks=(Mark("one line of twenty", y=SELDOM),),
    )
    verdicts = "; ".join(f"{each.model.name}: {each.against.verdict}" for each in some)
    return Figure(
        key,
        f"Prediction of the unseen response {name}, sensor of the {side}",
        f"Points with 95 % bars: measured data that were not fitted. {verdicts}.",
        "Gain and phase of an unseen response with predictions, and differences in deviations.",
        (gain, phase, *([left] if own else [])),
    )


def _over_time(
    key: str, name: str, side: str, some: Sequence[tuple[Prediction, Simulated]]
) -> Figure:
    shown, first = some[0]
    curves = [Curve(first.time, first.measured, "measured", "measured")]
    what, units = ("Angle", ("rad", "mrad")) if shown.is_angle else ("Rate", ("rad/s", "deg/s"))
    left = []
    for prediction, run in some:
        model = prediction.model.name
        curves.append(Curve(run.time, run.simulated, model, model, "thin"))
        left.append(Curve(run.time, run.measured - run.simulated, model, model, "thin"))
    return Figure(
        key,
        f"Unseen output over time, {name}, sensor of the {side}",
        "Output of the first recording and what models make of its torque, within the band of the "
        "fit; below, what is left over.",
        "Measured and simulated output over time, and their difference.",
        (
            Panel(TIME, Axis(f"{what}, within the band", *units), curves),
            Panel(TIME, Axis("Left over", *units), left),
        ),
    )


def residual_figures(found: Sequence[FrequencyFit], fits: Sequence[Model]) -> Iterator[Figure]:
    """Residuals of fits to their responses, over frequency and from line to line."""
    for number, each in enumerate(found, start=1):
        for side in each.source.responses:
            own = [m for m in fits if m.source is each.source and m.side == side]
            if own:
                yield _residuals(f"residuals-{number}-{side}", each, side, own)


def _residuals(key: str, each: FrequencyFit, side: str, own: Sequence[Model]) -> Figure:
    real, imaginary, alike = [], [], []
    widest = 0.0
    for model in own:
        frequency, left = weighted(model)
        real.append(Curve(frequency, left.real, model.name, model.name, "points"))
        imaginary.append(Curve(frequency, left.imag, model.name, model.name, "points"))
        most = min(LAGS, len(left) // 3)
        square = float(np.sum(np.abs(left) ** 2))
        lags = np.arange(most + 1)
        share = [float(np.real(np.vdot(left[: len(left) - k], left[k:]))) / square for k in lags]
        alike.append(Curve(lags.astype(float), np.array(share), model.name, model.name))
        widest = max(widest, 1.96 / math.sqrt(2.0 * len(left)))
        lag = lags.astype(float)
    band = Curve(
        lag, np.full(len(lag), widest), "white", "reference", "band",
        y_low=np.full(len(lag), -widest),
    )  # fmt: skip
    marks = (Mark("95 %", y=1.96), Mark("", y=-1.96))
    parts = "Residual over its deviation"
    return Figure(
        key,
        f"Residuals of the fits, {each.source.name}, sensor of the {side}",
        "Real and imaginary part over frequency, in deviations of the measurement (lines: 95 %), "
        "and how alike neighbouring lines are; white residuals stay in the band. Over time, rate "
        "or angle a response has no residuals: each of its values is made of all samples; what "
        "is left over time is in the error of the simulated output.",
        "Residuals of the fits over frequency and their autocorrelation over lines.",
        (
            Panel(FREQUENCY, Axis(parts), real, "Real part", marks),
            Panel(FREQUENCY, Axis(parts), imaginary, "Imaginary part", marks),
            Panel(Axis("Lag, lines"), Axis("Autocorrelation"), [band, *alike]),
        ),
        trials=each.source.trials,
    )


def weighted(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and complex residuals over the deviation of either part, each shape (n,)."""
    part = fitted_part(model.source, model.side, *model.band)
    size = np.maximum(np.sqrt(0.5 * (part.variance + part.bias**2)), 1e-300)
    return part.frequency, (part.values - model.value(part.frequency)) / size
