"""Settings for the whole suite."""

from __future__ import annotations

import hashlib
import os
import signal
import time
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import hypothesis
import pytest

from campaign.gc_threshold import raise_gc_threshold

# Nothing here may need a display, and what a terminal looks like must not depend on the machine.
os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it
for name in ("FORCE_COLOR", "NO_COLOR", "COLUMNS", "CAMPAIGN_DEBUG"):
    os.environ.pop(name, None)

# No deadline: a busy machine makes a test slower, not red. The usual draws are always the same, so
# that what is red has a cause in the change; `--hypothesis-profile=many` draws others, for a soak.
hypothesis.settings.register_profile("usual", deadline=None, derandomize=True)
hypothesis.settings.register_profile("many", deadline=None, max_examples=5000)
hypothesis.settings.load_profile("usual")

SLOW = 2.0
"""s of a core, alone, above which a test is to be marked `slow`."""
LONG = ("slow", "statistics", "soak")
ENDS = pytest.StashKey[float]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of this suite."""
    group = parser.getgroup("campaign")
    text = "leave out what has not ended after so many minutes; the order follows from --draw"
    group.addoption("--minutes", type=float, help=text)
    group.addoption("--draw", default="", help="any text, which decides what comes first")


def pytest_configure(config: pytest.Config) -> None:
    """The time starts now, and garbage is collected as seldom as in a run of the program."""
    raise_gc_threshold()
    config.stash[ENDS] = time.monotonic() + 60.0 * (config.getoption("--minutes") or 0.0)


def pytest_xdist_auto_num_workers() -> int:
    """Three workers for two cores: a test waits a quarter of its time for a clock, disk or process.

    With four, collecting and imports in each cost more than waiting.
    """
    cores = (
        os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)
    )
    return max(2, 3 * len(cores) // 2)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files with the most slow tests come first; a sample that is cut off is one of a draw."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])
    if config.getoption("--minutes"):
        draw = config.getoption("--draw")
        items.sort(key=lambda item: hashlib.sha256(f"{draw} {item.nodeid}".encode()).digest())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Ends a test as skipped when `--minutes` are over, and notes one that should be `slow`."""
    before = os.times()[:4]
    with ended_in_time(item.config) if item.config.getoption("--minutes") else nullcontext():
        done = yield
    used = sum(os.times()[:4]) - sum(before)
    if used > SLOW and not any(map(item.get_closest_marker, LONG)):
        item.user_properties.append(("core seconds", used))
    return done


@contextmanager
def ended_in_time(config: pytest.Config) -> Iterator[None]:
    """Skips what runs inside when the time of the sample is over."""

    def over(*_: object) -> None:
        pytest.skip("the time of the sample is over")

    before = signal.signal(signal.SIGALRM, over)
    signal.setitimer(signal.ITIMER_REAL, max(config.stash[ENDS] - time.monotonic(), 1e-3))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """What is to be marked `slow`: told, not failed, as a busy machine takes longer."""
    for report in terminalreporter.getreports("passed"):
        for _, used in report.user_properties:
            line = f"{report.nodeid}: {used:.1f} s of a core, and not marked slow"
            terminalreporter.write_line(line)
