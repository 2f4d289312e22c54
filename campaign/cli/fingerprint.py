"""`campaign fingerprint`: the fingerprint of a bench."""

from __future__ import annotations

from campaign.archive.layout.files import write_atomically
from campaign.cli.output import print_line, print_note
from campaign.errors import ExitCode, UsageError, writing
from campaign.physics.bench_fingerprint import fingerprint, why_altered
from campaign.protocol.bench_edit import with_known
from campaign.protocol.bench_file import bench_source, checked
from campaign.protocol.further_files import names_file


def fingerprint_bench(written: str, *, check: bool) -> ExitCode:
    """Write the bench's fingerprint into its file, or with `check` only compare.

    With `check`, returns TRIALS_FAILED (1) if the bench or one of its compensations differs from
    the stated fingerprint. Raises UsageError and ProtocolError.
    """
    source = bench_source(written)
    bench = checked(source)
    now = fingerprint(bench)
    methods = ("none", *bench.compensation)
    wrong = dict.fromkeys(filter(None, (why_altered(bench, method) for method in methods)))
    if not check and not names_file(written):
        raise UsageError(
            f"{written}: a shipped bench keeps its fingerprint; use --check, or name a file"
        )
    if not check and bench.known.fingerprint != now:
        text = with_known(source.text, {}, written)
        with writing(source.file):
            write_atomically(source.file, text)
        print_note(f"written to {written}")
    print_line(f"bench\t{now.bench}")
    for name, one in now.compensation.items():
        print_line(f"compensation {name}\t{one}")
    for line in wrong if check else ():
        print_line(f"altered: {line}")
    return ExitCode.TRIALS_FAILED if check and wrong else ExitCode.DONE
