"""Points of a matrix: validated options and benches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from pydantic import JsonValue, ValidationError

from campaign.axis_kind import axis_terms, in_axis_terms, sides_in
from campaign.errors import Problem
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.complete import IncompleteBenchError
from campaign.physics.truth import value_at
from campaign.protocol.matrix import Axis, points
from campaign.protocol.problems import validate
from campaign.protocol.schema import Test, origin_with_values, with_values
from campaign.protocol.swept_value_text import as_written
from campaign.trial import Tree, canonical_json


class PointError(Exception):
    """A point of a matrix at which a test cannot be executed."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = list(problems)
        super().__init__("; ".join(str(problem) for problem in problems))


def incomplete(test: Test, error: IncompleteBenchError) -> PointError:
    """The error for values that a test needs and its bench does not state."""
    message = f"test '{test.entry.name}' ({test.entry.kind}): {error}"
    return PointError([test.origin.problem(("bench",), "value", message)])


def first_line(error: Exception) -> str:
    """The message of an error in one line."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    # A pydantic message has a headline, a field and a sentence; all three are necessary.
    return " ".join(line.strip() for line in lines[:3])


def refused(test: Test, bench: Bench, error: Exception, where: str = "") -> PointError:
    """The error if an experiment refuses options and bench of a point."""
    if isinstance(error, IncompleteBenchError):
        return incomplete(test, error)
    reason = in_axis_terms(first_line(error), bench.sides)
    message = f"test '{test.entry.name}'{where}: {reason}"
    return PointError([test.origin.problem((), "value", message)])


@dataclass(frozen=True)
class Point:
    """A point of the matrix: swept path to SI value; options and bench as objects and as trees.

    Attributes:
        chosen: reason for each option value that the experiment chose for an unwritten option.
        told: swept values with a unit, as written in the protocol.
    """

    values: Mapping[str, JsonValue]
    options: Options
    options_tree: Tree
    bench: Bench
    bench_tree: Tree
    chosen: Mapping[str, str] = field(default_factory=dict)
    told: Mapping[str, str] = field(default_factory=dict)

    @property
    def written(self) -> Tree:
        """The options that the test writes, without defaults."""
        return self.options.model_dump(mode="json", exclude_unset=True)

    @property
    def label(self) -> str:
        texts = {path: self.told.get(path, value) for path, value in self.values.items()}
        return ", ".join(f"{path} = {value}" for path, value in texts.items())


def points_of(test: Test) -> Iterator[Point]:
    """Every point of the matrix, first axis slowest. Raises PointError for an invalid point."""
    cache = _Cache(test)
    for indices in points(test.axes):
        bench, bench_tree = cache.bench(indices)
        options, options_tree, chosen = cache.fitted(indices)
        values = {
            axis.path: value_at(bench_tree if axis.of_bench else options_tree, axis.keys)
            for axis in test.axes
        }
        pairs = zip(test.axes, indices, strict=True)
        texts = {axis.path: as_written(axis.value(index)) for axis, index in pairs}
        with_units = {path: text for path, text in texts.items() if text}
        yield Point(values, options, options_tree, bench, bench_tree, chosen, with_units)


def first_point(test: Test) -> Point:
    """The first point of the matrix. Raises PointError."""
    if not test.first:
        test.first.append(next(points_of(test)))
    point: Point = test.first[0]
    return point


@dataclass
class _Cache:
    """Cache of validated options and benches: a sweep of one does not change the other."""

    test: Test
    known_options: dict[tuple[int, ...], tuple[Options, Tree]] = field(default_factory=dict)
    known_benches: dict[tuple[int, ...], tuple[Bench, Tree]] = field(default_factory=dict)
    known_fits: dict[tuple[int, str], tuple[Options, Tree, Mapping[str, str]]] = field(
        default_factory=dict
    )
    plain_bench: Tree = field(default_factory=dict)

    def options(self, indices: tuple[int, ...]) -> tuple[Options, Tree]:
        swept = self._swept(indices, of_bench=False)
        key = tuple(index for _, index in swept)
        if key not in self.known_options:
            tree = with_values(self.test.options, swept)
            origin = origin_with_values(self.test.origin, swept)
            with axis_terms(sides_in(self.test.bench)):
                valid = validate(self.test.experiment.options, tree, origin)
            if isinstance(valid, list):
                raise PointError(valid)
            self.known_options[key] = (valid, valid.model_dump(mode="json"))
        return self.known_options[key]

    def fitted(self, indices: tuple[int, ...]) -> tuple[Options, Tree, Mapping[str, str]]:
        """Options with the experiment's choices for this bench, and their reasons."""
        options, tree = self.options(indices)
        fit = self.test.experiment.fit
        if fit is None:
            return options, tree, {}
        bench = self.bench(indices)[0]
        try:
            with axis_terms(bench.sides):
                chosen = fit(options, bench)
        except (ValueError, ArithmeticError) as error:
            raise refused(self.test, bench, error) from None
        if not chosen:
            return options, tree, {}
        key = (id(options), canonical_json({name: c.value for name, c in chosen.items()}))
        if key not in self.known_fits:
            values = {name: choice.value for name, choice in chosen.items()}
            fitted = options.model_copy(update=values)
            # These fields must not count as written options.
            fitted.__pydantic_fields_set__.difference_update(values)
            reasons = {
                name: in_axis_terms(choice.reason, bench.sides) for name, choice in chosen.items()
            }
            self.known_fits[key] = fitted, fitted.model_dump(mode="json"), reasons
        return self.known_fits[key]

    def bench(self, indices: tuple[int, ...]) -> tuple[Bench, Tree]:
        swept = self._swept(indices, of_bench=True)
        key = tuple(index for _, index in swept)
        if key not in self.known_benches:
            valid = self._swept_bench(swept)
            self.known_benches[key] = (valid, valid.model_dump(mode="json"))
        return self.known_benches[key]

    def _swept_bench(self, swept: Sequence[tuple[Axis, int]]) -> Bench:
        if not self.plain_bench:
            valid = Bench.model_validate(self.test.bench)
            self.plain_bench = valid.model_dump(mode="json")
        try:
            # Validation of the normalized bench is 20 times faster than of its text.
            tree = with_values(self.plain_bench, swept)
            return Bench.model_validate(tree, context={"si": True})
        except ValidationError:
            raw = with_values(self.test.bench, swept)
            again = validate(Bench, raw, origin_with_values(self.test.bench_origin, swept))
            if isinstance(again, Bench):
                return again
            raise PointError(again) from None

    def _swept(self, indices: tuple[int, ...], *, of_bench: bool) -> list[tuple[Axis, int]]:
        pairs = zip(self.test.axes, indices, strict=True)
        return [(axis, index) for axis, index in pairs if axis.of_bench is of_bench]
