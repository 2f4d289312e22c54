"""From a TOML file to a validated protocol, with all mistakes at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.axis_kind import axis_terms, sides_in
from campaign.errors import Problem, ProtocolError, UsageError
from campaign.options import TextFile
from campaign.physics.bench import Bench
from campaign.policy import Policy
from campaign.protocol.axes import is_large, make_axis, value_problems
from campaign.protocol.calibration import Calibration, CalibrationOptions
from campaign.protocol.collect import (
    Collection,
    Draft,
    apply_overrides,
    collect,
    sibling,
    top_level,
)
from campaign.protocol.files import Origin, PatchedTree, Source, Within, read_source
from campaign.protocol.further_files import FurtherFiles, read_any_text
from campaign.protocol.known_cells import cell_problems
from campaign.protocol.matrix import Axis
from campaign.protocol.operator import operator_problems
from campaign.protocol.overrides import Override, parse_overrides
from campaign.protocol.points import PointError, first_point
from campaign.protocol.positions import Keys
from campaign.protocol.problems import allowed, shown, validate
from campaign.protocol.schema import (
    CheckEntry,
    ExperimentKind,
    Protocol,
    ProtocolFile,
    Test,
    TestEntry,
    origin_with_values,
    replaced,
    split_entry,
    with_values,
)
from campaign.protocol.shapes import Read, attach, attach_values
from campaign.protocol.truth_file import Truths
from campaign.published.calibration_covariance import FOLDER, file_name
from campaign.text import nearest


def load_protocol(
    path: Path,
    experiments: Mapping[str, ExperimentKind],
    *,
    overrides: Sequence[str] = (),
    shipped: Path,
    truth: str = "",
) -> Protocol:
    """The protocol at `path` with everything it includes and every bench it names.

    Args:
        experiments: the available kinds of test, by name.
        overrides: `dotted.path=value` as given to `--set`.
        shipped: folder whose `benches/` holds the benches with a bare name.
        truth: a bench to simulate in place of each test's, as given to `--truth`.

    Raises ProtocolError with all problems of all files.
    """
    collected = Collection()
    settings, collected.problems = parse_overrides(overrides)
    source = collect(path, collected)
    if source is None:
        raise _failed(collected)
    apply_overrides(settings, collected)
    files = FurtherFiles(shipped, collected.problems, collected.sources, collected.chains)
    truths = Truths(FurtherFiles(shipped, collected.problems), truth)
    loader = _Loader(collected, experiments, files, truths)
    tests = loader.tests()
    tree, origin = top_level(source, settings)
    top = validate(ProtocolFile, tree, origin)
    if isinstance(top, list):
        collected.problems[:0] = top
        raise _failed(collected)
    published = loader.published(source, top.published, origin)
    calibration = loader.calibration(source, top.calibration, origin)
    loader.check(top.check, origin)
    if not collected.drafts and not collected.problems:
        message = "no tests; add a [[test]], or include a protocol that has some"
        collected.problems.append(Problem(path, 1, 1, message))
    if collected.problems:
        raise _failed(collected)
    return Protocol(
        path=path,
        title=top.title,
        description=top.description,
        operator=top.operator,
        notes=top.notes,
        tags=top.tags,
        published=published,
        tests=tuple(tests),
        sources={name: each.text for name, each in collected.sources.items()},
        overrides=tuple(overrides),
        calibration=calibration,
        policy=Policy(faults=top.faults, rest=top.rest, keep=top.keep),
        check=top.check,
        truth_sources=loader.truths.texts,
        columns=top.columns,
        origin=origin,
    )


def _failed(collected: Collection) -> ProtocolError:
    return ProtocolError(list(dict.fromkeys(collected.problems)))


@dataclass
class _Loader:
    """Validator of the collected tests; appends problems to `collected.problems`."""

    collected: Collection
    experiments: Mapping[str, ExperimentKind]
    files: FurtherFiles
    truths: Truths

    def tests(self) -> list[Test]:
        first: dict[str, Draft] = {}
        tests = []
        for draft in self.collected.drafts:
            earlier = first.setdefault(draft.name, draft)
            if draft.name and earlier is not draft:
                at = earlier.source.positions.find(("test", earlier.index, "name"))
                place = f"{earlier.source.file}:{at.line}:{at.column}"
                message = f"a second test called '{draft.name}'; the first is at {place}"
                self._report(draft.origin.problem(("name",), "value", message))
            test = self._test(draft)
            if test is not None:
                tests.append(test)
        return tests

    def published(self, source: Source, written: str, origin: Origin) -> str:
        """Name of the published values: "thesis", "none", or the source that this reads."""
        if written in ("thesis", "none"):
            return written
        file = sibling(source, written)
        values = self.files.read(read_source, *file, origin, ("published",), written)
        return values.name if values is not None else written

    def calibration(
        self, source: Source, options: CalibrationOptions | None, origin: Origin
    ) -> Calibration | None:
        """The calibration with its bench, which all tests must use."""
        if options is None:
            return None
        bench = self.files.bench(options.bench, source, origin, ("calibration", "bench"))
        if bench is None:
            return None
        for draft in self.collected.drafts:
            own = self._bench(draft)
            if own is not None and own is not bench:
                message = f"the calibration is of the bench {shown(options.bench)}; use it here too"
                self._report(draft.origin.problem(("bench",), "value", message))
        return Calibration(options, bench, origin)

    def check(self, entry: CheckEntry | None, origin: Origin) -> None:
        """Check the repeated trial; its test may be in an included protocol."""
        names = [draft.name for draft in self.collected.drafts]
        if entry is not None and entry.test not in names:
            message = f"no test is called {shown(entry.test)}; {allowed(names)}"
            message += nearest(entry.test, names)
            self._report(origin.problem(("check", "test"), "value", message))

    def _report(self, *problems: Problem) -> None:
        self.collected.problems += problems

    def _test(self, draft: Draft) -> Test | None:
        common, options = split_entry(draft.tree)
        entry = validate(TestEntry, common, draft.origin)
        if isinstance(entry, list):
            self._report(*entry)
        experiment = self._experiment(draft, common.get("kind"))
        bench = self._bench(draft)
        if experiment is None:
            return None
        tree = _patched(bench.tree, draft.bench_patches) if bench is not None else None
        patches = [(patch.keys, patch.origin) for patch in draft.bench_patches]
        bench_origin = PatchedTree(Within(bench), patches) if bench is not None else draft.origin
        valid = validate(Bench, tree, bench_origin) if tree is not None else None
        if isinstance(valid, list):
            self._report(*valid)
        known = valid.model_dump(mode="json") if isinstance(valid, Bench) else None
        if isinstance(valid, Bench) and bench is not None:
            folder = bench.file.parent
            self._report(*cell_problems(valid.known, bench_origin, folder))
        options = attach(experiment.options, options, self._reader(draft, draft.origin))
        with axis_terms(sides_in(tree)):
            axes = self._axes(draft, experiment, options, known)
            self._options(draft, experiment, options, axes)
        if isinstance(entry, list) or known is None or tree is None or bench is None:
            return None
        truth = None
        if isinstance(valid, Bench):
            truth = self.truths.of(draft, entry.truth, valid, axes)
        test = Test(
            entry, experiment, options, tree, bench.name, axes, draft.origin, bench_origin, truth
        )
        self._compensation(test, known)
        if not is_large(axes, entry.repeat):
            with axis_terms(sides_in(tree)):
                self._report(*value_problems(test))
        self._operator(test)
        return test

    def _experiment(self, draft: Draft, kind: Any) -> ExperimentKind | None:
        if not isinstance(kind, str):
            return None
        if kind in self.experiments:
            try:
                return self.experiments[kind]
            except UsageError as error:
                self._report(draft.origin.problem(("kind",), "value", str(error)))
                return None
        message = f"unknown kind {shown(kind)}; {allowed(self.experiments)}"
        message += nearest(kind, self.experiments)
        self._report(draft.origin.problem(("kind",), "value", message))
        return None

    def _bench(self, draft: Draft) -> Source | None:
        """The test's bench; the result of a calibration beside it is added to the sources."""
        bench = self.files.bench(draft.tree.get("bench"), draft.source, draft.origin, ("bench",))
        if bench is None:
            return None
        file, name = bench.file.parent / FOLDER / bench.file.name, file_name(bench.name)
        if file.is_file():
            self.files.read(read_any_text, file, name, draft.origin, ("bench",), str(file))
        return bench

    def _reader(self, draft: Draft, origin: Origin) -> Read:
        """A function that reads a file beside the draft's protocol and adds it to the sources."""

        def read(keys: Keys, written: str) -> TextFile:
            source = self.files.read(
                read_any_text, *sibling(draft.source, written), origin, keys, written
            )
            return TextFile(written) if source is None else TextFile(source.name, source.text)

        return read

    def _axes(
        self, draft: Draft, experiment: ExperimentKind, options: Any, bench: Any
    ) -> tuple[Axis, ...]:
        axes = []
        for path, (written, origin) in draft.axes.items():
            if path.split(".")[0] == "bench" and bench is None:
                continue  # only fields of a valid bench can be swept
            trees = {"options": options, "bench": bench}
            read = self._reader(draft, origin)
            keys = tuple(path.split("."))
            listed = attach_values(experiment.options, options, keys, written, read)
            axis = make_axis(path, listed, origin, experiment.options, trees)
            if isinstance(axis, list):
                self._report(*axis)
                continue
            if path in options:
                message = f"'{path}' is swept by the matrix and given here; remove one of the two"
                self._report(draft.origin.problem((path,), "key", message))
            axes.append(axis)
        return tuple(axes)

    def _options(
        self, draft: Draft, experiment: ExperimentKind, options: Any, axes: tuple[Axis, ...]
    ) -> None:
        """Validate the options with the first value of every axis."""
        swept = [(axis, 0) for axis in axes if not axis.of_bench]
        tree, origin = with_values(options, swept), origin_with_values(draft.origin, swept)
        valid = validate(experiment.options, tree, origin, also=TestEntry.model_fields)
        if isinstance(valid, list):
            self._report(*valid)

    def _operator(self, test: Test) -> None:
        """Check the operator steps at the first point of the matrix."""
        if not test.entry.operator or any(len(axis) == 0 for axis in test.axes):
            return
        try:
            point = first_point(test)
        except PointError:
            return  # reported at the value
        self._report(*operator_problems(test, point))

    def _compensation(self, test: Test, bench: Mapping[str, Any]) -> None:
        """Check that the bench has parameters for each method of the option `compensation`."""
        names = ["none", *bench["compensation"]]
        given: list[tuple[Any, Origin, Keys]]
        given = [(test.options.get("compensation"), test.origin, ("compensation",))]
        swept = next((axis for axis in test.axes if axis.path == "compensation"), None)
        if swept is not None and swept.listed:
            given = [(swept.value(i), swept.value_origin(i), ()) for i in range(len(swept))]
        for name, origin, keys in given:
            if isinstance(name, str) and name not in names:
                self._report(origin.problem(keys, "value", unknown_compensation(name, names, test)))


def unknown_compensation(name: str, names: Sequence[str], test: Test) -> str:
    """Message for a compensation without parameters in the test's bench."""
    where = f"the bench '{test.bench_name}'"
    return f"{shown(name)} is no compensation of {where}; {allowed(names)}{nearest(name, names)}"


def _patched(tree: Mapping[str, Any], patches: Sequence[Override]) -> dict[str, Any]:
    patched = dict(tree)
    for patch in patches:
        patched = replaced(patched, patch.keys, patch.value)
    return patched
