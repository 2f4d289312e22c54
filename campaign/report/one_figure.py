"""Single figures of a report, also for a paper's column."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.api.analysis import AnalysedTest
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import UsageError
from campaign.experiments.interface import Experiment
from campaign.plain_text import on_a_page
from campaign.protocol.problems import allowed
from campaign.published.values import Published
from campaign.report.content.document import document_of
from campaign.report.content.first_screen import leading_figure, most_telling
from campaign.report.drawing.figures import Column, in_column
from campaign.report.drawing.pdf import also_as_pdf
from campaign.report.output import replace_file
from campaign.report.page.damage_notice import notice_on_page
from campaign.report.page.drawings import drawings_of
from campaign.report.page.layout import lay_out
from campaign.text import nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

WRITTEN = ".campaign-figures"
"""Marker file of a folder of figures: a line with SHA-256 and name for each written file."""


ALL = "all"
"""Selects every figure, instead of `TEST/KEY`."""


def write_figures(
    run: RunReader,
    wanted: str,
    output: Path,
    *,
    experiments: Mapping[str, Experiment],
    measure_anew: bool = False,
    column: Column | None = None,
) -> tuple[tuple[Path, ...], tuple[Damage, ...]]:
    """Write the SVG and the CSV file of the figure `TEST/KEY`, or of all, into the folder `output`.

    The layout of the whole report is made, because it determines colours, names and published
    values. The bytes are those of the report's own files.

    column: width of a journal's column, 88 or 180 mm, with PDF files; file names end with it.

    Returns the paths of the drawings, and the damage of the run. Raises UsageError when the run has
    no such figure, when a file of that name is not from campaign, or when the folder cannot be
    written.
    """
    document = document_of(run, experiments, measure_anew=measure_anew)
    with ExitStack() as drawing:
        if column is not None:
            drawing.enter_context(in_column(column))
            drawing.enter_context(also_as_pdf())
        layout = lay_out(document)
    if document.damaged:
        notice_on_page(run, document.damaged, layout.folder)
    figures = {
        f"{section.test.name}/{figure.data.key}": figure
        for section in layout.sections
        for figure in section.figures
        if figure.data and figure.download
    }
    if wanted != ALL and wanted not in figures:
        slip = nearest(wanted, figures)
        raise UsageError(f"{wanted!r} is no figure of this run; {allowed([ALL, *figures])}{slip}")
    files: dict[str, bytes] = {}
    drawings = []
    for figure in figures.values() if wanted == ALL else [figures[wanted]]:
        name = Path(figure.file).stem + (f"-{column}" if column else "")
        for file in (figure.file, figure.file.removesuffix(".svg") + ".csv"):
            files[name + Path(file).suffix] = on_a_page(layout.folder.files[file]).encode()
        pdf = layout.folder.pdfs.get(figure.file.removesuffix(".svg") + ".pdf")
        if pdf is not None:
            files[f"{name}.pdf"] = pdf
        drawings.append(output / f"{name}.svg")
    _write(output, files)
    return tuple(drawings), document.damaged


def sheet_of(tests: Sequence[AnalysedTest], compared: Published, wanted: str) -> Canvas:
    """Matplotlib figure of a run, with its published values.

    wanted: `TEST/KEY`; a test's name for its leading figure; a unique key; "" for the figure on top
        of the report.

    Raises UsageError when `wanted` selects no figure, or several.
    """
    drawings = {f"{name}/{key}": each for (name, key), each in drawings_of(tests, compared).items()}
    meant = [name for name in drawings if name.partition("/")[2] == wanted]
    if not wanted and (leading := leading_figure(tests)):
        meant = ["/".join(leading)]
    for test in tests:
        if test.name == wanted and (figure := most_telling(test.result)):
            meant = [f"{wanted}/{figure.key}"]
    if wanted in drawings:
        meant = [wanted]
    if len(meant) != 1 or meant[0] not in drawings:
        what = "is no figure" if len(meant) != 1 or not wanted else "cannot be drawn"
        slip = nearest(wanted, drawings)
        raise UsageError(f"{wanted!r} {what} of this run; {allowed(drawings)}{slip}")
    return drawings[meant[0]].sheet()


def _write(output: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder without replacing a file that campaign did not write."""
    new = {f"{_digest(data)}  {name}": data for name, data in files.items()}
    marker = output / WRITTEN
    try:
        ours = (
            marker.read_text(encoding="utf-8", errors="replace").splitlines()
            if marker.is_file()
            else []
        )
        for name in files:
            path = output / name
            if (path.exists() or path.is_symlink()) and not _is_one_of(path, {*ours, *new}):
                raise UsageError(
                    f"{path} is there already and was not written by campaign, or was changed;"
                    " name another folder with --output, or move it away"
                )
        output.mkdir(parents=True, exist_ok=True)
        # The marker lists files before they are written, so that after a crash they are known.
        replace_file(marker, "".join(f"{line}\n" for line in dict.fromkeys((*ours, *new))).encode())
        for line, data in new.items():
            replace_file(output / line.partition("  ")[2], data)
    except OSError as error:
        raise UsageError(f"{output}: the figure cannot be written: {error.strerror}") from None


def _is_one_of(path: Path, lines: set[str]) -> bool:
    ordinary = path.is_file() and not path.is_symlink()
    return ordinary and f"{_digest(path.read_bytes())}  {path.name}" in lines


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
