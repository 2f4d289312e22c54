"""`campaign run --profile`: time by kind of work, on standard error."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from campaign.cli.output import print_note
from campaign.stopwatch import Spent, Stopwatch, Work

REST = "everything else"
FASTER = {
    Work.PREPARING: "reduce the matrix, or use `--only TEST`",
    Work.COMPILING: "done once per installation; `campaign warmup` does it before a run",
    Work.SETTING_UP: "a cost of each trial: use fewer and longer trials",
    Work.ENGINE: "use shorter trials, `--workers`, or a longer step if the error permits "
    "(`backend.longest_step`); the fastest sine and the stiffest contact limit the step",
    Work.SAMPLES: "reduce the sample_rate",
    Work.TRIAL_FILES: "reduce the sample_rate; use fewer, longer trials or a faster disk",
    Work.MEASURING: "reduce the sample_rate",
    Work.WAITING: "more `--workers`, if processors were idle; a real bench sets its own pace",
    Work.SEALING: "reduce the sample_rate; use fewer, longer trials or a faster disk",
    Work.REPORT: "leave --report out; `campaign report` makes it later",
}
"""Advice that reduces the time, by kind of work."""


@dataclass(frozen=True)
class Row:
    """Seconds on the clock, their share of the whole, and seconds of processors."""

    what: str
    clock: float
    share: float
    processor: float


def rows(spent: dict[Work, Spent], elapsed: float, processor: float, workers: int) -> Iterator[Row]:
    """Rows of the kinds of work, in order, and of the rest.

    Clock time of parallel work is its total time divided by `workers`. The waiting time of the main
    thread counts only without work of the workers. With threads the clock times add up to
    `elapsed`. Worker processes overlap with the journal and the sealed file.
    """
    at_work = sum(each.others for each in spent.values()) / workers
    left, left_processor = elapsed, processor
    for work, each in spent.items():
        clock = each.main + each.others / workers
        if work is Work.WAITING:
            clock = max(0.0, clock - at_work)
        left, left_processor = left - clock, left_processor - each.processor
        yield Row(work, clock, clock / elapsed, each.processor)
    yield Row(REST, max(0.0, left), max(0.0, left) / elapsed, max(0.0, left_processor))


def print_profile(stopwatch: Stopwatch, workers: int) -> None:
    """Print a table, and advice to reduce the largest part."""
    elapsed, processor = stopwatch.elapsed()
    table = list(rows(stopwatch.spent(), elapsed, processor, workers))
    threads = "1 worker" if workers == 1 else f"{workers} workers"
    print_note(f"{'where the time went':26}{'clock':>10}{'share':>8}{'processor':>12}")
    for row in table:
        print_note(f"  {row.what:24}{row.clock:8.2f} s{row.share:7.0%} {row.processor:9.2f} s")
    print_note(f"  {f'all, with {threads}':24}{elapsed:8.2f} s{1:7.0%} {processor:9.2f} s")
    longest = max(table, key=lambda row: row.clock)
    hint = FASTER.get(Work(longest.what)) if longest.what != REST else None
    if hint:
        print_note(f"longest: {longest.what}; {hint}")
