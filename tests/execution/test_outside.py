"""Asking the bench whether somebody has switched it off from outside."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from campaign.backends import calls
from campaign.execution.external_stop import INTERVAL, OutsideWatch
from campaign.execution.stop import StopSwitch
from campaign.recording import PanicStop
from tests.execution.fakes import FakeBackend, SwitchedBench

BY_EVE = PanicStop(3, "eve", 1.5)


@dataclass
class Clock:
    time: float = 5.0

    def __call__(self) -> float:
        return self.time


@dataclass
class Watched:
    bench: SwitchedBench = field(default_factory=SwitchedBench)
    switch: StopSwitch = field(default_factory=StopSwitch)
    clock: Clock = field(default_factory=Clock)
    found: list[PanicStop] = field(default_factory=list)

    def watch(self) -> OutsideWatch:
        def tell(stop: PanicStop) -> None:
            assert not self.switch(), "told before the run is asked to stop"
            self.found.append(stop)

        return OutsideWatch(self.bench, self.switch, tell, self.clock)


def test_a_stop_is_found_at_the_first_question_and_stops_the_run() -> None:
    here = Watched(SwitchedBench(stop=BY_EVE))
    watch = here.watch()
    assert watch.stop is None
    assert watch() is True
    assert watch.stop == BY_EVE
    assert here.found == [BY_EVE]
    assert here.switch.reason == "panic stop by eve"


def test_the_bench_is_asked_no_more_often_than_its_line_can_bear() -> None:
    here = Watched()
    watch = here.watch()
    assert not watch()
    here.bench.stop = BY_EVE
    here.clock.time += 0.9 * INTERVAL
    assert not watch()
    assert here.bench.asked == 1
    here.clock.time += 0.2 * INTERVAL
    assert watch()
    assert here.bench.asked == 2


def test_a_run_that_was_stopped_already_asks_only_when_it_is_told_to_look() -> None:
    here = Watched(SwitchedBench(stop=BY_EVE))
    watch = here.watch()
    here.switch.request("Ctrl-C")
    assert watch()
    assert here.bench.asked == 0
    here_found: list[PanicStop] = []
    watch = OutsideWatch(here.bench, here.switch, here_found.append, here.clock)
    watch.look()
    assert watch.stop == BY_EVE
    assert here_found == [BY_EVE]
    assert here.switch.reason == "Ctrl-C"  # who was first


def test_the_first_stop_is_the_one_that_counts() -> None:
    here = Watched(SwitchedBench(stop=BY_EVE))
    watch = here.watch()
    watch.look()
    here.bench.stop = PanicStop(4, "mallory")
    watch.look()
    assert watch.stop == BY_EVE
    assert here.found == [BY_EVE]


def test_nobody_need_be_told_and_the_clock_is_the_wall() -> None:
    watch = OutsideWatch(SwitchedBench(stop=BY_EVE), StopSwitch())
    assert watch()
    assert watch.stop == BY_EVE


def test_a_bench_that_nobody_else_can_switch_off_is_not_asked() -> None:
    switch = StopSwitch()
    watch = OutsideWatch(FakeBackend(), switch)
    assert not watch()
    watch.look()
    assert watch.stop is None
    switch.request("Ctrl-C")
    assert watch()


@pytest.mark.parametrize(("age", "known"), [(5, 5), (1.5, 1.5), (float("nan"), None), ("5", None)])
def test_the_age_of_a_stop_is_a_number_or_not_known(age: object, known: float | None) -> None:
    stop = PanicStop(3, "eve", age)  # type: ignore[arg-type]
    backend = type("Stopped", (), {"panic_stop": lambda self: stop})()
    assert calls.panic_stop(backend) == PanicStop(3, "eve", known)
