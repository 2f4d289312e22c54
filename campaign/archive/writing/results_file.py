"""Writing `RUN-results.nxs`: results as NeXus, beside the run.

Each process of the file is the analysis of one test. Each panel of its figures and each of its
tables can be plotted; viewers open the most important one. This program reads back one text,
`record`, which refers to the arrays by path. The same results give the same bytes.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import h5py
import numpy as np

from campaign.archive.layout.files import PART, publish, why
from campaign.archive.layout.names import results_path
from campaign.archive.layout.results import ENTRY, FORMAT, HASH, RECORD, ResultsOfTest, RunResults
from campaign.archive.layout.results_text import to_text
from campaign.archive.reading.results_file import is_results_file
from campaign.archive.writing import hdf5
from campaign.archive.writing.plots import (
    INTERVAL,
    Plot,
    floats,
    joined,
    labels,
    names_of,
    parts_of,
    plots_of,
    unused,
)
from campaign.archive.writing.result_tables import put_findings, put_table
from campaign.errors import ArchiveError, UsageError
from campaign.result import Array, Curve, Figure, Panel, Table

_Keyed = TypeVar("_Keyed", Figure, Table)
PUBLISHED = "published"
ARRAYS = "arrays"
"""Arrays of results that are in no plot."""
MEMBERS = ("title", "entry_identifier", "program_name", "run", RECORD, ARRAYS)
"""Members of the entry other than the tests."""


def _refuse_foreign(run: Path) -> None:
    """Raise UsageError if a file at the results path of `run` is not a results file."""
    path = results_path(run)
    if (path.exists() or path.is_symlink()) and not is_results_file(path):
        raise UsageError(
            f"{path} is there already, holds no results of campaign and stays; results are written "
            "there once it is moved away"
        )


@dataclass(frozen=True)
class PreparedResults:
    """Results in a temporary file, not valid until published."""

    part: Path
    path: Path

    def publish(self) -> Path:
        """Move them to the results path, replacing older ones. Raises as `prepare_results`."""
        try:
            publish(self.part, self.path)
        except OSError as error:
            raise _cannot_be_written(self.path, error) from None
        return self.path

    def discard(self) -> None:
        """Remove the temporary file, if not published."""
        with suppress(OSError):
            self.part.unlink(missing_ok=True)


def prepare_results(run: Path, found: RunResults) -> PreparedResults:
    """Write the results of the run at `run`, without replacing any. The caller discards them.

    Raises UsageError if another file is at the results path, ArchiveError if the write fails; the
    existing file stays unchanged.
    """
    _refuse_foreign(run)
    path = results_path(run)
    prepared = PreparedResults(path.with_name(f".{path.name}.{os.getpid()}{PART}"), path)
    try:
        with hdf5.closing(hdf5.create_file(prepared.part)) as file:
            place = _Writer(file).write(found)
        hdf5.put_file_hash(prepared.part, place)
    except OSError as error:
        prepared.discard()
        raise _cannot_be_written(path, error) from None
    except BaseException:
        prepared.discard()
        raise
    return prepared


def _cannot_be_written(path: Path, error: OSError) -> ArchiveError:
    return ArchiveError(f"{path}: results cannot be written: {why(error)}")


class _Writer:
    """Writer of a results file; `places` maps the id of each array to its path in the file."""

    def __init__(self, file: h5py.File) -> None:
        self.file = file
        self.places: dict[int, str] = {}

    def write(self, found: RunResults) -> tuple[int, int]:
        """Write all content; return the offset and length of the file's hash."""
        hdf5.put_root(self.file, found.version, found.date, ENTRY)
        entry = hdf5.make_group(self.file, ENTRY, "NXentry")
        _describe(entry, found)
        names = names_of([*MEMBERS, *(test.name for test in found.tests), PUBLISHED])[
            len(MEMBERS) :
        ]
        opened: dict[str, str] = {}
        for number, (test, name) in enumerate(zip(found.tests, names, strict=False), start=1):
            if self._test(entry, name, number, test, found):
                opened[test.name] = name
        most_important = opened.get(found.telling[0]) if found.telling else None
        shown = [most_important, *opened.values()]
        if found.published is not None:
            process = _process(entry, names[-1], len(names), "campaign", found.version, found.date)
            if put_table(process, "table", found.published, signal="deviation"):
                hdf5.put_attribute(process, "default", "table")
                shown.append(names[-1])
        if default := next(filter(None, shown), None):
            hdf5.put_attribute(entry, "default", default)
        self._record(entry, found)
        group, _, name = HASH.partition("/")
        return hdf5.blank_digest(entry[group], name)

    def _record(self, entry: h5py.Group, found: RunResults) -> None:
        """Write the record text; arrays that are in no plot go into a group beside it."""
        arrays = hdf5.make_group(entry, ARRAYS, "NXcollection")
        others: list[Array] = []  # keeps the arrays alive: a new array could reuse a freed id

        def place(array: Array) -> str:
            if id(array) not in self.places:
                others.append(array)
                name = f"array_{len(others)}"
                hdf5.put_series(arrays, name, floats(array).ravel())
                self.places[id(array)] = f"{ARRAYS}/{name}"
            return self.places[id(array)]

        _note(entry, RECORD, "application/json", to_text(found, place))

    def _test(
        self, entry: h5py.Group, name: str, number: int, test: ResultsOfTest, found: RunResults
    ) -> bool:
        """Write the analysis of one test; return whether it contains a plot."""
        version = test.version or found.version
        process = _process(entry, name, number, test.program, version, found.date)
        part = hdf5.make_group(process, "test", "NXcollection")
        for field in ("name", "kind", "title", "problem"):
            hdf5.put_text(part, field, getattr(test, field))
        result = test.result
        if result.notes:
            _note(process, "notes", "text/plain", "\n".join(result.notes))
        for part, findings in (
            ("key_numbers", result.key_numbers),
            ("findings", result.findings),
        ):
            if findings:
                put_findings(process, part, findings)
        figures = {
            figure.key: next(iter(shown), "")
            for key, figure in _named(result.figures)
            if (shown := list(self._figure(process, f"{name}/", f"figure_{key}", figure)))
        }
        tables = [
            f"table_{key}"
            for key, table in _named(result.tables)
            if put_table(process, f"table_{key}", table)
        ]
        wanted = found.telling[1] if found.telling and found.telling[0] == test.name else ""
        default = (
            figures.get(wanted)
            or figures.get(result.telling)
            or next(iter([*figures.values(), *tables]), "")
        )
        if default:
            hdf5.put_attribute(process, "default", default)
        return bool(default)

    def _figure(self, process: h5py.Group, inside: str, name: str, figure: Figure) -> Iterator[str]:
        """Write the plots of a figure; yield the name of each."""
        for number, panel in enumerate(figure.panels, start=1):
            sound = Panel(panel.x, panel.y, [c for c in panel.curves if _plottable(c)], panel.title)
            for place, plot in enumerate(plots_of(sound), start=1):
                own = f"{name}_{number}" + (f"_{place}" if place > 1 else "")
                self._plot(process, inside, own, figure, panel, plot)
                yield own

    def _plot(
        self, process: h5py.Group, inside: str, name: str, figure: Figure, panel: Panel, plot: Plot
    ) -> None:
        group = hdf5.make_group(process, name, "NXdata")
        title = f"{figure.title}: {panel.title}" if panel.title else figure.title
        hdf5.put_text(group, "title", title)
        hdf5.put_attribute(group, "caption", figure.caption)
        names = [each for each, _, _ in plot.curves]
        together = joined(plot)
        x_name, whole = names_of([*names, panel.x.label.lower() or "x", "all"])[-2:]
        hdf5.put_attribute(group, "signal", names[0] if together is None else whole)
        if names[1:] and together is None:
            group.attrs["auxiliary_signals"] = names[1:]
        group.attrs["axes"] = [x_name]
        group.attrs[f"{x_name}_indices"] = np.array([0], dtype="<i4")
        _put_scales(group, panel)
        at = "; ".join(f"{place:g}: {name}" for place, name in panel.x.places)
        hdf5.put_series(group, x_name, plot.x, **labels(panel.x, f" ({at})" if at else ""))
        if together is not None:
            hdf5.put_series(group, whole, together.y, **labels(panel.y))
            for ending, values, _ in parts_of(together):
                part = f"{whole}_{ending}"
                hdf5.put_series(group, part, values, **labels(panel.y, f", {INTERVAL[ending]}"))
        for own, curve, start in plot.curves:
            cut = _cut(curve, plot, start)
            attributes = labels(panel.y, _which(curve, plot))
            hdf5.put_series(group, own, plot.spread(floats(curve.y), start), **attributes)
            self.places[id(curve.x)] = f"{inside}{name}/{x_name}{cut}"
            self.places[id(curve.y)] = f"{inside}{name}/{own}{cut}"
        for own, curve, start in plot.curves:
            for ending, values, array in parts_of(curve):
                part = unused(f"{own}_{ending}", group)
                attributes = labels(panel.y, f"{_which(curve, plot)}, {INTERVAL[ending]}")
                hdf5.put_series(group, part, plot.spread(values, start), **attributes)
                if array is not None:
                    self.places[id(array)] = f"{inside}{name}/{part}{_cut(curve, plot, start)}"
        hdf5.attach_time(group, x_name)


def _process(
    entry: h5py.Group, name: str, number: int, program: str, version: str, date: str
) -> h5py.Group:
    process = hdf5.make_group(entry, name, "NXprocess")
    hdf5.put_text(process, "program", program)
    hdf5.put_text(process, "version", version)
    hdf5.put_text(process, "date", date)
    hdf5.put_integer(process, "sequence_index", number)
    return process


def _named(items: Sequence[_Keyed]) -> Iterable[tuple[str, _Keyed]]:
    """Figures or tables, each with a valid and unique name from its key."""
    return zip(names_of([each.key for each in items]), items, strict=True)


def _note(parent: h5py.Group, name: str, kind: str, text: str) -> None:
    note = hdf5.make_group(parent, name, "NXnote")
    hdf5.put_text(note, "type", kind)
    hdf5.put_text(note, "data", text)


def _describe(entry: h5py.Group, found: RunResults) -> None:
    hdf5.put_text(entry, "title", f"Results: {found.title or found.run}")
    hdf5.put_text(entry, "entry_identifier", found.run)
    hdf5.put_text(entry, "program_name", "campaign", version=found.version)
    run = hdf5.make_group(entry, "run", "NXcollection")
    hdf5.put_integer(run, "format", FORMAT)
    texts = {
        "name": found.run,
        "file_name": found.file,
        "sha256": found.root,
        "date": found.date,
        "analysed_by": f"campaign {found.version}, sources sha256 {found.sources}",
        "damaged": "\n".join(found.damaged),
    }
    for name, text in texts.items():
        hdf5.put_text(run, name, text)


def _put_scales(group: h5py.Group, panel: Panel) -> None:
    """Attribute that selects logarithmic axes in silx and H5Web."""
    if "log" in (panel.x.scale, panel.y.scale):
        style = f'{{"axes_scale_types":["{panel.x.scale}"],"signal_scale_type":"{panel.y.scale}"}}'
        hdf5.put_attribute(group, "SILX_style", style)


def _cut(curve: Curve, plot: Plot, start: int) -> str:
    """Slice of the curve in a series over all of x, as text; empty if it is the whole series."""
    length = len(curve.x)
    return "" if length == len(plot.x) else f":{start}:{start + length}"


def _which(curve: Curve, plot: Plot) -> str:
    """Label of the curve; empty for the first of its plot, whose name viewers put at the axis."""
    return f", {curve.label}" if curve.label and curve is not plot.curves[0][1] else ""


def _plottable(curve: Curve) -> bool:
    """Whether all arrays have one value per x; other curves (from plug-ins) are only archived."""
    arrays = (curve.x, curve.y, curve.low, curve.high, curve.y_low)
    return all(each is None or np.shape(each) == (len(curve.x),) for each in arrays)
