"""The `[known]` table of a bench: source cells, and uncertainty of its values.

No value here affects motion. A status of the scoreboard depends on `given`, `fitted` and `seen`;
`fingerprint` identifies the bench for which they are true (`bench_fingerprint`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, model_validator

from campaign.axis_kind import BOTH_ROTARY
from campaign.options import LaterOptions, Options, spelled
from campaign.physics.friction_paths import Keys, invalid
from campaign.units import Quantity, split_quantity

NORMAL_95 = 1.959963984540054
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""
Number = float | str
"""SI value; text with a unit before its quantity is known."""


class KnownValue(Options):
    """Uncertainty and origin of a bench value."""

    interval: tuple[Number, Number] | None = None
    """Ends of its 95 % interval, in the unit of the value."""
    standard_uncertainty: Number | None = None
    """Its standard deviation, in the unit of the value or in percent; instead of the interval."""
    origin: Literal["given", "measured", "fitted", "assumed"] = "given"
    """Its source: a document or data sheet, a measurement, a calibration, an assumption."""

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if self.interval is not None and self.standard_uncertainty is not None:
            raise ValueError("'interval' and 'standard_uncertainty' say the same; remove one")
        return self

    @property
    def standard_deviation(self) -> float | None:
        """1 sigma (SI); None if no uncertainty is stated."""
        if self.interval is not None:
            low, high = (float(end) for end in self.interval)
            return (high - low) / (2.0 * NORMAL_95)
        return None if self.standard_uncertainty is None else float(self.standard_uncertainty)


class FingerprintOptions(Options):
    """Identity of the bench that `known` describes; `campaign fingerprint` writes it."""

    bench: Annotated[str, spelled(r"[0-9a-f]{16}", "16 hexadecimal digits")]
    """Fingerprint of all that affects motion except the compensations."""
    compensation: dict[str, str] = {}
    """Fingerprint of each compensation, by name."""


class IdentifiedOptions(Options):
    """Source of the values that `campaign identify` wrote."""

    run: str
    """The run, and its test if one was named."""
    digest: str
    """Digest of the run."""
    program: str
    """Program and version."""
    command: str
    """The command."""


class KnownOptions(LaterOptions):
    """Uncertainties of a bench, and the published cells that it is based on.

    Cells are named by `table`, `table/row` or `table/row/column`; `*` stands for any name.
    """

    later = frozenset({"identified"})

    document: str = ""
    """Source of the cells: "thesis", or a file of published values, relative to the bench."""
    given: tuple[str, ...] = ()
    """Published cells that are inputs of the bench; results for them are `recovered`."""
    fitted: tuple[str, ...] = ()
    """Published cells that the bench was fitted to; they are `calibrated`."""
    seen: tuple[str, ...] = ()
    """Published cells that were inspected to choose its structure; they are `selected`."""
    operating: tuple[str, ...] = ()
    """Paths of the bench that a test may change without altering the bench: preload, day."""
    values: dict[str, KnownValue] = {}
    """Uncertainty of values, by their path, e.g. "motor.torque_constant"."""
    correlations: tuple[tuple[str, str, float], ...] = ()
    """Pairs of paths in `values` with correlated errors, and their correlation coefficient."""
    fingerprint: FingerprintOptions | None = None
    """Identity of the bench that all of this describes."""
    identified: IdentifiedOptions | None = None
    """Recordings that values were identified from."""

    @property
    def describes(self) -> bool:
        """Whether it states anything that is valid for one bench only."""
        return bool(self.given or self.fitted or self.seen or self.fingerprint)


def number_at(bench: BaseModel, path: str) -> tuple[float, Quantity | None] | None:
    """Number at a dotted path of a bench (SI) and its quantity; None without a number."""
    node: Any = bench
    quantity: Quantity | None = None
    sides = getattr(bench, "sides", BOTH_ROTARY)
    for key in path.split("."):
        if isinstance(node, Mapping) and key in node:
            node = node[key]
        elif isinstance(node, BaseModel) and key in type(node).model_fields:
            field = type(node).model_fields[key]
            if getattr(node, "side", "") == "motor":
                sides = sides.at_motor
            quantity = next(_quantities((*field.metadata, field.annotation)), None)
            node = getattr(node, key)
        else:
            return None
    if isinstance(node, bool) or not isinstance(node, int | float):
        return None
    return float(node), quantity and quantity.of(sides)


def _quantities(hints: Iterable[Any]) -> Iterator[Quantity]:
    """Physical quantities among the hints of a field, or inside an optional type."""
    for hint in hints:
        if isinstance(hint, Quantity):
            yield hint
        else:
            yield from _quantities((*getattr(hint, "__metadata__", ()), *get_args(hint)))


def known_in_si(bench: Any) -> KnownOptions:
    """The `known` table of a bench file, with SI numbers in place of text.

    Raises pydantic's error for a path without a number, and for an invalid value.
    """
    known: KnownOptions = bench.known
    faults: list[tuple[Keys, str]] = []
    values: dict[str, KnownValue] = {}
    for path, entry in known.values.items():
        at = number_at(bench, path)
        values[path] = entry if at is None else _parsed(entry, *at, ("values", path), faults)
    faults += _wrong_paths(known, bench)
    if faults:
        raise invalid([(("known", *keys), message) for keys, message in faults])
    return known.model_copy(update={"values": values})


def _wrong_paths(known: KnownOptions, bench: BaseModel) -> Iterator[tuple[Keys, str]]:
    """Invalid paths and correlations: keys below `known`, and the message."""
    for path in known.values:
        if number_at(bench, path) is None:
            yield ("values", path), f"the bench has no number at '{path}'"
    for index, path in enumerate(known.operating):
        if number_at(bench, path) is None:
            yield ("operating", index), f"the bench has no number at '{path}'"
        elif path in known.values and known.values[path].origin == "fitted":
            message = f"'{path}' was fitted; a test that changes it is of another bench"
            yield ("operating", index), message
    for index, (one, other, share) in enumerate(known.correlations):
        for place, path in enumerate((one, other)):
            if path not in known.values:
                yield ("correlations", index, place), f"'{path}' is none of known.values"
        if not -1.0 <= share <= 1.0:
            yield ("correlations", index, 2), f"{share:g} is no correlation; it is from -1 to 1"


def _parsed(
    entry: KnownValue,
    value: float,
    quantity: Quantity | None,
    keys: Keys,
    faults: list[tuple[Keys, str]],
) -> KnownValue:
    def number(written: Number, *below: str | int) -> float:
        try:
            return _number(written, value, quantity, relative=below[0] == "standard_uncertainty")
        except ValueError as error:
            faults.append(((*keys, *below), str(error)))
            return math.nan  # causes no second message

    if entry.interval is not None:
        low, high = (number(end, "interval", index) for index, end in enumerate(entry.interval))
        if low > high:
            faults.append(((*keys, "interval"), "the lower end comes first"))
        return entry.model_copy(update={"interval": (low, high)})
    if entry.standard_uncertainty is None:
        return entry
    sigma = number(entry.standard_uncertainty, "standard_uncertainty")
    if sigma < 0:
        faults.append(((*keys, "standard_uncertainty"), "a standard deviation is not negative"))
    return entry.model_copy(update={"standard_uncertainty": sigma})


def _number(written: Number, value: float, quantity: Quantity | None, *, relative: bool) -> float:
    """SI value of a written number; ValueError with a message for the user."""
    if not isinstance(written, str):
        if quantity is not None:
            raise ValueError(
                f"{written:g} has no unit; write it as text, such as {quantity.example}"
            )
        return written
    share, unit = split_quantity(written)
    if unit == "%" and relative:
        return abs(value) * share / 100.0
    if quantity is None:
        raise ValueError(f"'{written}' is text, and the value is a number without a unit")
    return quantity.parse_own(written)
