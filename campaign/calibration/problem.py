"""Calibration problem from a protocol's `[calibration]`; every mistake has its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from campaign.calibration.space import Parameter, Space
from campaign.calibration.targets import DEFAULT_WEIGHT, Target, make_target, weight_of
from campaign.errors import Problem, ProtocolError, UsageError
from campaign.estimation.unknowns import Unknown
from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import number_at
from campaign.protocol import Protocol
from campaign.protocol.calibration import Calibration, CalibrationOptions, CalibrationParameter
from campaign.protocol.positions import Keys
from campaign.protocol.problems import allowed, find_faults, shown
from campaign.protocol.schema import Test
from campaign.published.patterns import covers
from campaign.published.values import Cell, Published
from campaign.text import nearest
from campaign.units import Quantity, split_quantity

MANY_PARAMETERS = 12
"""A table of about 30 cells can hardly distinguish more parameters."""


@dataclass(frozen=True)
class CalibrationProblem:
    """Parameters, target cells and tests of a calibration.

    Attributes:
        tests: those that reproduce a table with a target.
        published: all published values, for naming.
        warnings: sentences on questionable settings.
    """

    protocol: Protocol
    calibration: Calibration
    space: Space
    targets: tuple[Target, ...]
    tests: tuple[Test, ...]
    published: Published
    warnings: tuple[str, ...] = ()

    @property
    def options(self) -> CalibrationOptions:
        return self.calibration.options


def make_problem(protocol: Protocol, published: Published) -> CalibrationProblem:
    """Problem that `protocol` states. Raises ProtocolError with all mistakes and their places."""
    calibration = protocol.calibration
    if calibration is None:
        raise UsageError(
            f"{protocol.path} has no [calibration]; docs/calibration.md says what it holds"
        )
    if any(test.truth is not None for test in protocol.tests):
        raise UsageError(
            f"{protocol.path}: a calibration simulates the bench that it fits: no truth"
        )
    reader = _Reader(protocol, calibration, published)
    targets = reader.targets()
    parameters = reader.parameters()
    if not reader.problems:
        reader.check_bounds(parameters)
    if reader.problems:
        raise ProtocolError(list(dict.fromkeys(reader.problems)))
    tables = {target.cell.table for target in targets}
    tests = tuple(t for t in protocol.tests if tables & set(t.entry.reproduces))
    warnings = []
    if len(parameters) > MANY_PARAMETERS:
        warnings.append(
            f"{len(parameters)} parameters; more than {MANY_PARAMETERS} are seldom distinguishable"
        )
    if len(targets) <= len(parameters):
        warnings.append(
            f"{len(targets)} cells for {len(parameters)} parameters; there will be no intervals"
        )
    return CalibrationProblem(
        protocol, calibration, Space(parameters), targets, tests, published, tuple(warnings)
    )


class _Reader:
    """Resolves the names and units of one calibration; mistakes go to `problems`."""

    def __init__(self, protocol: Protocol, calibration: Calibration, published: Published) -> None:
        self.problems: list[Problem] = []
        self._protocol = protocol
        self._calibration = calibration
        self._options = calibration.options
        self._published = published
        self._written = calibration.bench.tree
        self._bench: Mapping[str, Any] = Bench.model_validate(self._written).model_dump(mode="json")

    def targets(self) -> tuple[Target, ...]:
        """The cells in printed order, each with its weight."""
        wanted = self._chosen("cells", self._options.cells)
        left_out = self._chosen("without", self._options.without)
        for name in self._options.weights if not self.problems else ():
            if not any(covers(name, path) for path in wanted):
                message = f"{shown(name)} is none of the calibration's cells"
                self._report(("weights", name), message, aim_key=True)
        stood_for = {name for test in self._protocol.tests for name in test.entry.reproduces}
        targets = []
        refused: set[str | None] = set()
        for path, cell in wanted.items():
            if path in left_out:
                continue
            if cell.table not in stood_for:
                message = f"no test reproduces {cell.table!r}; add it to a test's 'reproduces'"
                index = next(i for i, p in enumerate(self._options.cells) if covers(p, path))
                self._report(("cells", index), message)
                continue
            key = weight_of(cell, self._options.weights)
            weight = self._options.weights[key] if key is not None else DEFAULT_WEIGHT
            try:
                targets.append(make_target(cell, weight))
            except ValueError as error:
                if key not in refused:  # once for all cells with this weight
                    self._report(("weights",) if key is None else ("weights", key), str(error))
                refused.add(key)
        return tuple(targets)

    def parameters(self) -> tuple[Parameter, ...]:
        """The unknowns in the order they were written."""
        parameters = []
        names: set[str] = set()
        driven: dict[str, str] = {}
        for index, entry in enumerate(self._options.parameter):
            if entry.name in names:
                self._report(("parameter", index, "name"), f"a second {shown(entry.name)}")
            names.add(entry.name)
            for keys, path in _places(entry):
                if path in driven:
                    message = f"{shown(path)} is driven by {shown(driven[path])} already"
                    self._report(("parameter", index, *keys), message)
                driven[path] = entry.name
            before = len(self.problems)
            parameter = self._parameter(index, entry)
            if parameter is not None and len(self.problems) == before:
                parameters.append(parameter)
        return tuple(parameters)

    def check_bounds(self, parameters: tuple[Parameter, ...]) -> None:
        """Report bounds that the bench does not accept, with all other values unchanged."""
        for index, parameter in enumerate(parameters):
            for side, value in (
                ("lower", parameter.unknown.lower),
                ("upper", parameter.unknown.upper),
            ):
                tree = Space((parameter,)).bench(self._written, (value,))
                faults = find_faults(Bench, tree)
                for keys, _, message in faults if isinstance(faults, list) else ():
                    place = ".".join(str(key) for key in keys)
                    self._report(("parameter", index, side), f"with this value, {place}: {message}")

    def _chosen(self, key: str, patterns: tuple[str, ...]) -> dict[str, Cell]:
        matches: dict[str, Cell] = {}
        for index, pattern in enumerate(patterns):
            cells = [
                cell
                for table in self._published.values()
                for cell in table.cells
                if covers(pattern, cell.path)
            ]
            if not cells:
                table = self._published.get(pattern.split("/")[0])
                if table is None:
                    names = list(self._published)
                    message = f"no published table is called {shown(pattern.split('/')[0])}"
                else:
                    names = [cell.path for cell in table.cells]
                    message = f"{shown(pattern)} is no cell of {table.heading}; {allowed(names)}"
                self._report((key, index), message + nearest(pattern, names))
            matches |= {cell.path: cell for cell in cells}
        printed = [cell.path for table in self._published.values() for cell in table.cells]
        return {path: matches[path] for path in printed if path in matches}

    def _parameter(self, index: int, entry: CalibrationParameter) -> Parameter | None:
        factors = entry.factors or (1.0,) * len(entry.fields)
        fields = []
        for keys, path in _places(entry):
            if not self._may_be_fitted(("parameter", index, *keys), path):
                return None
            fields.append((path, self._quantity(path)))
        quantity = fields[0][1]
        for (keys, path), (_, other) in zip(_places(entry), fields, strict=True):
            if other != quantity:
                message = (
                    f"{shown(path)} is {_kind(other)}, {shown(fields[0][0])} {_kind(quantity)}"
                )
                self._report(("parameter", index, *keys), message)
                return None
        lower = self._bound(index, "lower", entry.lower, quantity)
        upper = self._bound(index, "upper", entry.upper, quantity)
        if lower is None or upper is None:
            return None
        if not lower < upper:
            self._report(("parameter", index, "upper"), "it must be greater than 'lower'")
            return None
        if entry.scale == "log" and lower <= 0:
            message = "a logarithmic scale needs a lower bound above zero"
            self._report(("parameter", index, "lower"), message)
            return None
        present = float(_at(self._bench, fields[0][0])) / factors[0]
        if not lower <= present <= upper:
            message = (
                f"the bench's present value, {_at(self._written, fields[0][0])}, is not between "
                "'lower' and 'upper'; it is where the first fit starts"
            )
            self._report(("parameter", index, "lower"), message)
            return None
        unit = split_quantity(entry.lower)[1] if isinstance(entry.lower, str) else ""
        unknown = Unknown(entry.name, lower, upper, present, entry.scale == "log")
        return Parameter(unknown, tuple(zip(entry.fields, factors, strict=True)), quantity, unit)

    def _may_be_fitted(self, place: Keys, path: str) -> bool:
        """Whether the bench file has a number there that no test sweeps; reports why not."""
        keys = tuple(path.split("."))
        numbers = dict(_numbers(self._written, self._bench))
        if path not in numbers:
            message = (
                f"the bench writes no number at {shown(path)}; only what stands in its file can "
                f"be fitted{nearest(path, numbers)}"
            )
            self._report(place, message)
            return False
        for test in self._protocol.tests:
            if any(axis.of_bench and axis.keys == keys for axis in test.axes):
                self._report(place, f"{shown(path)} is swept by the test '{test.entry.name}'")
                return False
        return True

    def _quantity(self, path: str) -> Quantity | None:
        field = number_at(Bench.model_validate(self._bench, context={"si": True}), path)
        return None if field is None else field[1]

    def _bound(
        self, index: int, side: str, written: str | float, quantity: Quantity | None
    ) -> float | None:
        try:
            if isinstance(quantity, Quantity):
                if not isinstance(written, str):
                    raise ValueError(
                        f"{written:g} has no unit; expected a {quantity.name} such as "
                        f"{quantity.example}"
                    )
                return quantity.parse_own(written)
            if isinstance(written, str):
                raise ValueError(f"{shown(written)} is text; this field is a number without a unit")
            return float(written)
        except ValueError as error:
            self._report(("parameter", index, side), str(error))
            return None

    def _report(self, keys: Keys, message: str, *, aim_key: bool = False) -> None:
        aim: Any = "key" if aim_key else "value"
        self.problems.append(self._calibration.origin.problem(("calibration", *keys), aim, message))


def _places(entry: CalibrationParameter) -> Iterator[tuple[Keys, str]]:
    """Paths of a parameter, each with its keys in the table."""
    if entry.path:
        yield ("path",), entry.path
    for index, path in enumerate(entry.paths):
        yield ("paths", index), path


def _kind(quantity: Quantity | None) -> str:
    return f"a {quantity.name}" if isinstance(quantity, Quantity) else "a number without a unit"


def _numbers(written: Any, valid: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted path and value of every number in a bench file, as number or text with a unit."""
    if isinstance(written, Mapping):
        for key, value in written.items():
            below = valid.get(key) if isinstance(valid, Mapping) else None
            yield from _numbers(value, below, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(valid, float):
        yield prefix, written


def _at(tree: Any, path: str) -> Any:
    for key in path.split("."):
        tree = tree[key]
    return tree
