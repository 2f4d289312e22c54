"""A bench without a protocol, from its TOML file or a shipped name."""

from __future__ import annotations

from pathlib import Path

from campaign.errors import ProtocolError, UsageError
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, IncompleteBenchError, complete
from campaign.protocol.files import Source, UnreadableError, Within, read_source
from campaign.protocol.further_files import benches_in, names_file, no_bench
from campaign.protocol.known_cells import cell_problems
from campaign.protocol.problems import validate
from campaign.resources import protocols_folder


def load_bench(written: str) -> Bench:
    """The bench in the file `written`, or the shipped one of that name.

    Raises UsageError if there is none, ProtocolError with all its problems.
    """
    return checked(bench_source(written))


def simulable(written: str) -> CompleteBench:
    """The same for simulation. Raises UsageError with all values that the bench lacks."""
    try:
        return complete(load_bench(written))
    except IncompleteBenchError as error:
        raise UsageError(f"{written}: {error}") from None


def bench_source(written: str) -> Source:
    """The source of that bench. Raises UsageError if missing, ProtocolError for invalid TOML."""
    file = _find(written)
    try:
        source = read_source(file, written, "bench")
    except UnreadableError as error:
        raise UsageError(f"{written}: {error}") from None
    if not isinstance(source, Source):
        raise ProtocolError(source)
    return source


def checked(source: Source) -> Bench:
    """The bench in a file. Raises ProtocolError with all its problems."""
    origin = Within(source)
    bench = validate(Bench, source.tree, origin)
    if not isinstance(bench, Bench):
        raise ProtocolError(bench)
    problems = list(cell_problems(bench.known, origin, source.file.parent, must_be_there=True))
    if problems:
        raise ProtocolError(problems)
    return bench


def _find(written: str) -> Path:
    if names_file(written):
        return Path(written)
    known = benches_in(protocols_folder())
    if written not in known:
        raise UsageError(no_bench(written, known))
    return known[written]
