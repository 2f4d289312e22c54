"""The device in C led through random scripts: the tables' answers, and a drive that stays off."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from campaign.wire import messages as wire
from campaign.wire.messages import State

from .console import Console
from .host import CRC, OTHERS, OURS, SETS, TRIAL, asked, hello, only, take
from .model import TIMEOUT, Model

LATEST = wire.Unlatch(2**32 - 1, "the count that was shown")
"""Stands for an UNLATCH with the count of the latest stop."""
RECORDS = 16

COMMAND = st.sampled_from(
    [
        hello(), hello(), hello(OTHERS, "eve"), hello(OTHERS, ""), *SETS, SETS[0], wire.Arm(CRC),
        wire.Arm(CRC), wire.Arm(1), wire.Start(TRIAL), wire.Start(TRIAL), wire.Stop(),
        wire.Release(TRIAL), wire.Release(8), wire.Clear(), wire.Clear(),
        wire.Safe(), wire.Safe(0, "mallory"), wire.Safe(OURS, "ada"), wire.Safe(OTHERS, "eve"),
        wire.Safe(OTHERS, "eve"), wire.Safe(99),
        wire.Heartbeat(1, TRIAL, 0, OURS), wire.Heartbeat(2, TRIAL, 3, OURS),
        wire.Heartbeat(3, TRIAL, 99, OTHERS), wire.Heartbeat(4, TRIAL, 2, 0),
        LATEST, LATEST, wire.Unlatch(0, "ada"), wire.Unlatch(1, "ada"), wire.Query(),
        wire.Bye(OURS), wire.Bye(OTHERS), wire.Bye(99),
    ]
)  # fmt: skip
A_TRIAL = (
    wire.Heartbeat(5, TRIAL, 0, OURS), wire.Clear(), SETS[0], wire.Arm(CRC), wire.Start(TRIAL),
)  # fmt: skip
STEP = st.one_of(
    st.tuples(st.just("send"), COMMAND, st.sampled_from(["next"] * 8 + ["same", "far"])),
    st.tuples(st.just("send"), COMMAND, st.just("next")),
    st.tuples(st.just("try")),
    st.tuples(st.just("wait"), st.sampled_from([1000, TIMEOUT - 1, TIMEOUT + 1])),
    st.tuples(st.just("rest"), st.booleans()),
    st.tuples(st.just("persists"), st.booleans()),
    st.tuples(st.just("memory"), st.booleans()),
    st.tuples(st.just("samples")),
    st.tuples(st.just("finish"), st.sampled_from(wire.Outcome)),
    st.sampled_from([("reset",), ("reset",), ("wipe",)]),
)
PAST = st.sampled_from(["", "", "latched 3", "forgetful"])
SCRIPTS = settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


class Script:
    """One device, its model, and a host that numbers its commands."""

    def __init__(self, console: Console, past: str) -> None:
        self.console, self.sequence = console, 0
        console.do("new", RECORDS, *past.split())
        console.now = 0
        self.model = Model.new(past)

    def send(self, message: wire.Message, turn: str = "next") -> list[wire.Message | str]:
        """What the device does upon it, after a comparison with the model."""
        if message is LATEST:
            message = wire.Unlatch(self.model.latch.count, "ada")
        if wire.encode(message)[0] in wire.COMMANDS:
            self.sequence = (self.sequence + {"next": 1, "same": 0, "far": 7}[turn]) % 2**16
        expected = self.model.receive(self.console.now, self.sequence, message)
        done = self.console.upon(self.sequence, message)
        if isinstance(expected, wire.NakCode):
            assert only(wire.Nak, done)[0].code is expected, message
        elif isinstance(expected, State):
            assert only(wire.Ack, done) or only(wire.Capabilities, done), message
        return done

    def step(self, step: tuple) -> None:
        """One step of any kind."""
        console, model = self.console, self.model
        if step[0] == "send":
            self.send(step[1], step[2])
        elif step[0] == "try":
            for message in A_TRIAL:
                self.send(message)
        elif step[0] == "wait":
            console.wait(step[1])
            model.tick(console.now)
        elif step[0] == "samples":
            assert bool(take(console, 0)) == model.samples()
        elif step[0] == "finish":
            console.do("finish", int(step[1]), int(wire.Fault.DRIVE), "-")
            model.finish(console.now, step[1])
        elif step[0] in ("reset", "wipe"):
            console.do(step[0])
            self.model = model.reset() if step[0] == "reset" else model.wiped()
        else:
            setattr(model, step[0], step[1])
            console.do(step[0], int(step[1]))

    def compare(self) -> None:
        """Ask, which changes nothing."""
        model, now = self.model, self.console.now
        self.console.wait(0)  # what is due comes after what is answered
        model.tick(now)
        status, latch, holder = asked(self.console)
        oldest = max(model.first, model.records - RECORDS)
        assert (status.trial, status.next_record) == (model.trial, model.records)
        assert (status.state, status.first_record) == (model.state, oldest)
        assert (status.boot, status.heartbeat) == (model.boot, model.counter)
        assert (latch.latched, latch.count, latch.cause, latch.by) == model.latch.facts()
        assert (holder.held, holder.host) == (model.held(now), model.host)
        age = None if model.heard is None else (now - model.heard) / 1e6
        assert holder.age == age
        assert status.drive_on == (model.state is State.RUNNING)


REMEMBERED_LATER = [("memory", False), ("send", wire.Safe(), "next"), ("memory", True), ("reset",)]


@pytest.mark.slow
@SCRIPTS
@given(past=PAST, running=st.booleans(), steps=st.lists(STEP, max_size=25))
@example(past="", running=False, steps=REMEMBERED_LATER)
def test_any_script_leads_both_through_the_same_states(
    console: Console, past: str, running: bool, steps: list[tuple]
) -> None:
    script = Script(console, past)
    script.send(hello())
    if running:
        script.send(LATEST)
        script.step(("try",))
    script.compare()
    for step in steps:
        script.step(step)
        script.compare()


class Judge:
    """Knows from what is sent and answered alone whether the drive must stay off.

    Attributes:
        stopped: somebody from outside has stopped it, and no UNLATCH was acknowledged since.
    """

    def __init__(self, *, stopped: bool) -> None:
        self.stopped = stopped
        self._session: int | None = None

    def judge(self, message: wire.Message | None, done: list[wire.Message | str]) -> None:
        """`done`: what the device did upon `message`, or with none, by itself."""
        if isinstance(message, wire.Safe | wire.Unlatch):
            [answered] = [i for i, what in enumerate(done) if isinstance(what, wire.Ack | wire.Nak)]
            assert not [what for what in done[answered:] if str(what).startswith("remember")]
        if isinstance(message, wire.Safe):
            assert done[0] == "drive off"
            assert isinstance(done[1], wire.Ack) or str(done[1]).startswith("remember 1 ")
            if message.session == 0 or message.session != self._session:
                self.stopped = True
        if self.stopped:
            assert "drive on" not in done
            assert not [s for s in only(wire.Status, done) if s.drive_on]
        if isinstance(message, wire.Hello) and only(wire.Capabilities, done):
            self._session = message.session
        if isinstance(message, wire.Unlatch) and only(wire.Ack, done):
            [latch] = only(wire.Latch, done)
            self.stopped = latch.latched

    def reset(self) -> None:
        """Power off and on: the session is forgotten, a stop is not."""
        self._session = None


@SCRIPTS
@given(past=PAST, steps=st.lists(STEP, max_size=40))
def test_after_a_stop_from_outside_the_drive_stays_off_until_it_is_cleared(
    console: Console, past: str, steps: list[tuple]
) -> None:
    """Whatever the script, with a memory that works: judged by the calls of the hooks."""
    script, judge = Script(console, past), Judge(stopped=bool(past))
    started = 0
    for step in [("send", hello(), "next"), ("try",), *steps]:
        if step[0] == "memory":
            continue
        sent = A_TRIAL if step[0] == "try" else step[1:2] if step[0] == "send" else ()
        if step[0] in ("reset", "wipe"):
            script.step(step)
            judge.reset()
            judge.stopped = judge.stopped or step[0] == "wipe" or past == "forgetful"
        elif not sent:
            before = len(console.log)
            script.step(step)
            assert not (judge.stopped and "drive on" in console.log[before:])
        for message in sent:
            done = script.send(message, step[2] if step[0] == "send" else "next")
            judge.judge(message, done)
            started += done.count("drive on")
    assert console.log.count("drive on") == started
