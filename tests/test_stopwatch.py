"""Where the time goes: by a clock of our own, since no test may tell by the machine's."""

from __future__ import annotations

import threading

import pytest

import campaign.stopwatch
from campaign.cli.profile import FASTER, REST, rows
from campaign.stopwatch import UNTIMED, Spent, Stopwatch, Work


class Clock:
    """Seconds as we say; of processors half of them."""

    def __init__(self) -> None:
        self.now = 100.0

    def perf_counter(self) -> float:
        return self.now

    def thread_time(self) -> float:
        return self.now / 2

    def process_time(self) -> float:
        return self.now / 2


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    ours = Clock()
    monkeypatch.setattr(campaign.stopwatch, "time", ours)
    return ours


def test_work_inside_of_other_work_counts_once(clock: Clock) -> None:
    stopwatch = Stopwatch()
    clock.now += 5.0  # nobody's
    with stopwatch.span(Work.SAMPLES):
        clock.now += 1.0
        with stopwatch.span(Work.TRIAL_FILES):
            clock.now += 2.0
            with stopwatch.span(Work.SEALING):
                clock.now += 4.0
        clock.now += 8.0
    assert stopwatch.spent() == {
        Work.SAMPLES: Spent(9.0, 0.0, 4.5),
        Work.TRIAL_FILES: Spent(2.0, 0.0, 1.0),
        Work.SEALING: Spent(4.0, 0.0, 2.0),
    }
    assert stopwatch.elapsed() == (20.0, 10.0)


def test_what_raises_is_counted_and_what_comes_after_is_not(clock: Clock) -> None:
    def fails() -> None:
        with stopwatch.span(Work.REPORT):
            clock.now += 3.0
            raise ValueError("no")

    stopwatch = Stopwatch()
    with pytest.raises(ValueError, match="no"):
        fails()
    clock.now += 7.0
    assert stopwatch.spent() == {Work.REPORT: Spent(3.0, 0.0, 1.5)}


def test_items_cost_what_making_them_costs_and_not_what_is_done_with_them(clock: Clock) -> None:
    def blocks():
        for seconds in (1.0, 2.0):
            clock.now += seconds
            yield seconds
        clock.now += 4.0

    stopwatch = Stopwatch()
    with stopwatch.span(Work.SAMPLES):
        for _ in stopwatch.each(Work.ENGINE, blocks()):
            clock.now += 10.0
    spent = stopwatch.spent()
    assert spent[Work.ENGINE].main == 7.0
    assert spent[Work.SAMPLES].main == 20.0


def test_threads_are_measured_apart(clock: Clock) -> None:
    stopwatch = Stopwatch()

    def work() -> None:
        with stopwatch.span(Work.ENGINE):
            clock.now += 3.0

    with stopwatch.span(Work.WAITING):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    spent = stopwatch.spent()
    assert (spent[Work.ENGINE].main, spent[Work.ENGINE].others) == (0.0, 3.0)
    assert (spent[Work.WAITING].main, spent[Work.WAITING].others) == (3.0, 0.0)


def test_the_clocks_of_all_rows_are_the_whole() -> None:
    """Ten seconds: two of a plan, six in which two workers work for four and for five, one idle."""
    spent = {
        Work.PREPARING: Spent(2.0, 0.0, 1.5),
        Work.ENGINE: Spent(0.0, 7.0, 6.0),
        Work.TRIAL_FILES: Spent(0.0, 2.0, 1.0),
        Work.WAITING: Spent(6.0, 0.0, 0.1),
        Work.SEALING: Spent(1.0, 0.0, 1.0),
    }
    table = {row.what: row for row in rows(spent, elapsed=10.0, processor=10.0, workers=2)}
    assert table[Work.ENGINE].clock == 3.5
    assert table[Work.TRIAL_FILES].clock == 1.0
    assert table[Work.WAITING].clock == 1.5
    assert table[REST].clock == 1.0
    assert table[REST].processor == pytest.approx(0.4)
    assert sum(row.clock for row in table.values()) == 10.0
    assert sum(row.share for row in table.values()) == pytest.approx(1.0)


def test_whoever_is_untimed_measures_nothing_and_changes_nothing() -> None:
    items = [1, 2]
    assert UNTIMED.each(Work.ENGINE, items) is items
    with UNTIMED.span(Work.ENGINE), UNTIMED.span(Work.ENGINE):
        pass


def test_each_kind_of_work_but_importing_has_a_word_on_how_to_shorten_it() -> None:
    assert set(Work) - set(FASTER) == {Work.IMPORTING}
