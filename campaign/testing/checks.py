"""Checks of a backend against the interface."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from campaign.backends.interface import Backend, ExecutesTogether, SupportsExternalStop
from campaign.errors import BackendError
from campaign.recording import Array, Ending, Outcome, PanicStop, Recording, SafeState
from campaign.testing.archive_check import archived_as_recorded
from campaign.testing.backend_under_test import BackendUnderTest, Check, CheckFailedError, require
from campaign.testing.strict_recorder import StrictRecorder
from campaign.testing.supervised_backend import Disturb, got_through, supervised, with_narrow_limit
from campaign.trial import Trial, canonical_json
from campaign.units import factor

LATEST = 0.2
"""s; maximum age of a live backend's sample at its delivery."""
PATIENCE = 30.0
"""s of wall-clock time until a call must return."""
_NAME = re.compile(r"[a-z][a-z0-9_]{0,62}\Z")


def backend_checks() -> dict[str, Check]:
    """All checks by name; the name states the requirement."""
    checks = (
        accepts_a_possible_trial,
        refuses_an_impossible_trial_naming_the_field,
        announces_channels_once_before_samples,
        announces_the_channels_it_names,
        holds_slower_channels,
        describes_channels_in_known_units,
        appends_blocks_that_fit_the_channels,
        keeps_the_promised_sample_times,
        keeps_the_duration_without_gaps,
        ends_as_it_says,
        ends_a_failing_trial_as_a_fault,
        stops_in_mid_trial,
        stops_before_the_first_sample,
        stops_no_other_trial,
        makes_safe_as_often_as_asked,
        passes_the_supervision,
        is_ended_at_a_limit_and_made_safe,
        is_ended_at_an_undefined_sample,
        is_ended_when_its_time_stands_still,
        hands_samples_over_in_time,
        is_made_safe_while_it_hangs,
        keeps_a_stop_from_outside,
        executes_twice,
        executes_together_what_it_does_alone,
        lets_go_when_left,
        lets_exceptions_pass,
        records_what_can_be_archived,
    )
    return {check.__name__: check for check in checks}


def accepts_a_possible_trial(under_test: BackendUnderTest) -> None:
    """`refuses` returns None for an executable trial, before and after connecting."""
    backend = under_test.open()
    reason = backend.refuses(under_test.possible)
    require(reason is None, f"refuses() said {reason!r} of the possible trial")
    with backend as connected:
        reason = connected.refuses(under_test.possible)
    require(reason is None, f"refuses() said {reason!r} of the possible trial, once connected")


def refuses_an_impossible_trial_naming_the_field(under_test: BackendUnderTest) -> None:
    """`refuses` states the reason and names the field that a user can change."""
    reason = under_test.open().refuses(under_test.impossible)
    require(reason, "refuses() had nothing against the impossible trial")
    named = under_test.names in str(reason)
    require(named, f"refuses() said {reason!r}, which does not name {under_test.names!r}")


def announces_channels_once_before_samples(under_test: BackendUnderTest) -> None:
    """`start` is called once, before any sample."""
    recorder, _ = _executed(under_test)
    require(not recorder.order, "; ".join(recorder.order))
    require(recorder.channels, "no channel was announced")


def announces_the_channels_it_names(under_test: BackendUnderTest) -> None:
    """`channels`, before and after connecting, names the channels that are then announced."""
    trial = under_test.possible
    with under_test.open() as backend:
        named = (under_test.open().channels(trial), backend.channels(trial))
        recorder, _ = _on(backend, trial)
    announced = {info.name for info in recorder.channels}
    for names in named:
        message = f"channels() named {sorted(names or ())}, and {sorted(announced)} were announced"
        require(names is None or names == announced, message)


def holds_slower_channels(under_test: BackendUnderTest) -> None:
    """A channel with its own rate changes at most at that rate; its values are held."""
    recording, _ = _recorded(under_test)
    rate = under_test.possible.task.sample_rate
    for name, channel in recording.channels.items():
        own = channel.own_rate
        if own is None:
            continue
        require(0 < own <= rate, f"{name}: its own rate is {own:g} Hz of {rate:g} Hz recorded")
        changes = int(np.count_nonzero(np.diff(channel.samples)))  # NaN differs from any value
        most = own * len(recording.time) / rate + 1
        require(changes <= most, f"{name}: {changes} values at {own:g} Hz; at most {most:g} can be")


def describes_channels_in_known_units(under_test: BackendUnderTest) -> None:
    """Names are unique and valid in an archive; the SI unit converts to the displayed unit."""
    recorder, _ = _executed(under_test)
    names = [info.name for info in recorder.channels]
    require(len(set(names)) == len(names), f"two channels share a name: {', '.join(names)}")
    for info in recorder.channels:
        good = _NAME.match(info.name) and info.name != "time"
        require(good, f"{info.name!r}: a name has lower-case letters, digits and _; not 'time'")
        require(info.label.strip(), f"{info.name}: has no label for people")
        try:
            to_si = factor(info.display_unit, info.unit) if info.unit != info.display_unit else 1.0
        except ValueError as error:
            message = f"{info.name}: {info.display_unit!r} does not convert to {info.unit!r}"
            raise CheckFailedError(f"{message}: {error}") from None
        require(to_si > 0, f"{info.name}: {info.display_unit!r} is no multiple of {info.unit!r}")


def appends_blocks_that_fit_the_channels(under_test: BackendUnderTest) -> None:
    """Float64, time (n,), block (channels, n); events with a time and a text."""
    recorder, _ = _executed(under_test)
    require(not recorder.shapes, "; ".join(recorder.shapes))


def keeps_the_promised_sample_times(under_test: BackendUnderTest) -> None:
    """Sample i is at i / sample_rate, from 0 on, across blocks; to a thousandth of a sample."""
    time = _recorded(under_test)[0].time
    rate = under_test.possible.task.sample_rate
    require(len(time) > 1, f"{len(time)} samples were recorded")
    wrong = ~(np.abs(time * rate - np.arange(len(time))) < 1e-3)  # NaN is wrong, too
    first = int(np.argmax(wrong))
    where = f"sample {first} is at {time[first]:.9g} s, not at {first / rate:.9g} s"
    require(not wrong.any(), where)


def keeps_the_duration_without_gaps(under_test: BackendUnderTest) -> None:
    """A completed trial has all samples of its duration (±1), and all are finite."""
    recording, ending = _recorded(under_test)
    outcome = f"{ending.outcome}: {ending.reason}"
    require(ending.outcome is Outcome.COMPLETED, f"the possible trial ended as {outcome}")
    task = under_test.possible.task
    wanted = task.duration * task.sample_rate
    count = len(recording.time)
    require(abs(count - wanted) <= 1, f"{count} samples in place of {wanted:g}")
    for name, channel in recording.channels.items():
        missing = int(np.count_nonzero(~np.isfinite(channel.samples)))
        require(not missing, f"{name}: {missing} samples are missing in a completed trial")


def ends_as_it_says(under_test: BackendUnderTest) -> None:
    """Completed: no reason, no fault, safe; telemetry is JSON."""
    _, ending = _executed(under_test)
    _consistent(ending)
    safe = ending.safe_state is SafeState.CONFIRMED
    require(safe, "the safe state was not confirmed after a completed trial")


def ends_a_failing_trial_as_a_fault(under_test: BackendUnderTest) -> None:
    """A failing bench results in an ending with fault and reason, not in an exception."""
    if under_test.failing is None:
        return
    try:
        with under_test.failing() as backend:
            ending = backend.execute(under_test.possible, StrictRecorder(), lambda: False)
    except BackendError as error:
        raise CheckFailedError(f"a failing bench raised BackendError: {error}") from error
    message = f"a failing bench ended the trial as {ending.outcome}"
    require(ending.outcome in (Outcome.FAULT, Outcome.LIMIT, Outcome.DIVERGED), message)
    _consistent(ending)


def stops_in_mid_trial(under_test: BackendUnderTest) -> None:
    """After `stopped()` becomes true, the trial ends within a few blocks, interrupted and safe."""
    asked_after = 1
    recorder = StrictRecorder()
    _interrupted(under_test, recorder, lambda: recorder.blocks >= asked_after)
    more = recorder.blocks - asked_after
    allowed = under_test.most_blocks
    require(more <= allowed, f"{more} blocks came after the stop; at most {allowed} may")


def stops_before_the_first_sample(under_test: BackendUnderTest) -> None:
    """A stop requested before the trial ends it immediately."""
    recorder = StrictRecorder()
    _interrupted(under_test, recorder, lambda: True)
    allowed = under_test.most_blocks
    require(recorder.blocks <= allowed, f"{recorder.blocks} blocks came; at most {allowed} may")


def makes_safe_as_often_as_asked(under_test: BackendUnderTest) -> None:
    """`make_safe` confirms before a trial, after it, and when called again."""
    with under_test.open() as backend:
        seen = [backend.make_safe()]
        backend.execute(under_test.possible, StrictRecorder(), lambda: False)
        seen += [backend.make_safe(), backend.make_safe()]
    for when, state in zip(("before", "after", "again after"), seen, strict=True):
        confirmed = state is SafeState.CONFIRMED
        require(confirmed, f"make_safe() {when} a trial answered {state!r}, not CONFIRMED")


def stops_no_other_trial(under_test: BackendUnderTest) -> None:
    """Each trial has its own stop flag: a stopped trial does not stop the next one."""
    with under_test.open() as backend:
        first = backend.execute(under_test.possible, StrictRecorder(), lambda: True)
        second = backend.execute(under_test.possible, StrictRecorder(), lambda: False)
    as_asked = (first.outcome, second.outcome) == (Outcome.INTERRUPTED, Outcome.COMPLETED)
    message = f"a trial that was stopped, and one that was not, ended as {first.outcome}"
    require(as_asked, f"{message} and {second.outcome}")


def passes_the_supervision(under_test: BackendUnderTest) -> None:
    """The supervision of a run accepts channels, time, values, limits and length."""
    end = supervised(under_test)
    message = f"a run would end the possible trial as {end.ending.outcome}: {end.ending.reason}"
    require(end.ending.outcome is Outcome.COMPLETED, message)


def is_ended_at_a_limit_and_made_safe(under_test: BackendUnderTest) -> None:
    """It stops after the supervision detects an exceeded limit; its bench is made safe."""
    recording, _ = _recorded(under_test)
    watched, channel = with_narrow_limit(under_test, recording)
    _ended(under_test, Outcome.LIMIT, f"{channel} exceeded its limit", watched=watched)


def is_ended_at_an_undefined_sample(under_test: BackendUnderTest) -> None:
    """It stops after the supervision detects an undefined sample; its bench is made safe."""

    def undefined(time: Array, block: Array) -> tuple[Array, Array]:
        return time, np.full_like(block, np.nan)

    _ended(under_test, Outcome.DIVERGED, "a sample was undefined", disturb=undefined)


def is_ended_when_its_time_stands_still(under_test: BackendUnderTest) -> None:
    """It stops after the supervision detects a time that stands still; its bench is made safe."""

    def standing(time: Array, block: Array) -> tuple[Array, Array]:
        return np.zeros_like(time), block

    _ended(under_test, Outcome.FAULT, "its time stood still", disturb=standing)


def hands_samples_over_in_time(under_test: BackendUnderTest) -> None:
    """Live: the median block spans at most 0.2 s; single delays of the host are allowed."""
    if not under_test.live:
        return
    recorder, ending = _executed(under_test)
    require(recorder.sizes, f"nothing was recorded: {ending.outcome}, {ending.reason}")
    spans = np.array(recorder.sizes) / under_test.possible.task.sample_rate
    usual = float(np.median(spans))
    require(usual <= LATEST, f"samples come {usual:.3g} s at a time; at most {LATEST:g} s may")


def is_made_safe_while_it_hangs(under_test: BackendUnderTest) -> None:
    """Live: `make_safe` works from another thread while `execute` does not return."""
    if not under_test.live:
        return
    state = got_through(under_test, PATIENCE)
    confirmed = state is SafeState.CONFIRMED
    require(confirmed, f"make_safe() while execute() hung answered {state!r}, not CONFIRMED")


def executes_twice(under_test: BackendUnderTest) -> None:
    """A second trial starts at time 0, with the length and channels of the first."""
    with under_test.open() as backend:
        executions = [_on(backend, under_test.possible) for _ in range(2)]
    (first, _), (second, ending) = executions
    require(ending.outcome is Outcome.COMPLETED, f"the second ended as {ending.outcome}")
    require(first.channels == second.channels, "the second announced other channels")
    times = [recorder.recording(ending).time for recorder, ending in executions]
    same = np.array_equal(times[0], times[1])
    require(same, f"{len(times[0])} samples first, then {len(times[1])}, or at other times")


def lets_go_when_left(under_test: BackendUnderTest) -> None:
    """After leaving, a new backend and the same one can be entered again immediately."""
    first = under_test.open()
    for which, backend in (("first", first), ("second", under_test.open()), ("first", first)):
        try:
            with backend as entered:
                state = entered.make_safe()
        except Exception as error:
            raise CheckFailedError(f"entering the {which} backend failed: {error!r}") from error
        require(state is SafeState.CONFIRMED, f"the {which} backend answered {state!r}")


def lets_exceptions_pass(under_test: BackendUnderTest) -> None:
    """Leaving suppresses no exception of the caller."""
    try:
        with under_test.open():
            raise KeyError("of the user")
    except KeyError:
        return
    raise CheckFailedError("__exit__ returned true: it hides the exceptions of others")


def records_what_can_be_archived(under_test: BackendUnderTest) -> None:
    """A run of this trial is sealed and reads back as recorded."""
    recorder, ending = _executed(under_test)
    require(recorder.blocks, "nothing was recorded")
    archived_as_recorded(under_test.possible, recorder.channels, recorder.recording(ending))


def _executed(under_test: BackendUnderTest) -> tuple[StrictRecorder, Ending]:
    with under_test.open() as backend:
        return _on(backend, under_test.possible)


def _recorded(under_test: BackendUnderTest) -> tuple[Recording, Ending]:
    recorder, ending = _executed(under_test)
    return recorder.recording(ending), ending


def _on(backend: Backend, trial: Trial) -> tuple[StrictRecorder, Ending]:
    recorder = StrictRecorder()
    ending = backend.execute(trial, recorder, lambda: False)
    return recorder, ending


def _ended(
    under_test: BackendUnderTest,
    outcome: Outcome,
    why: str,
    *,
    watched: Trial | None = None,
    disturb: Disturb = lambda time, block: (time, block),
) -> None:
    """Execute under a supervision that ends the trial; require `outcome`."""
    end = supervised(under_test, watched=watched, disturb=disturb)
    message = f"{why}, and the trial ended as {end.ending.outcome}: {end.ending.reason}"
    require(end.ending.outcome is outcome, message)
    allowed = under_test.most_blocks
    require(end.after <= allowed, f"{why}; {end.after} blocks came after; at most {allowed} may")
    if under_test.live:
        safe = end.made_safe and end.made_safe[-1] is SafeState.CONFIRMED
        require(safe, f"{why}; make_safe() then did not answer CONFIRMED")


def _interrupted(
    under_test: BackendUnderTest, recorder: StrictRecorder, stopped: Callable[[], bool]
) -> None:
    with under_test.open() as backend:
        ending = backend.execute(under_test.possible, recorder, stopped)
        state = backend.make_safe()
    message = f"a stopped trial ended as {ending.outcome}, not as interrupted"
    require(ending.outcome is Outcome.INTERRUPTED, message)
    _consistent(ending)
    require(state is SafeState.CONFIRMED, "the safe state was not confirmed after a stop")


def _consistent(ending: Ending) -> None:
    require(isinstance(ending, Ending), f"execute() returned {ending!r}, not an Ending")
    failed = ending.outcome is Outcome.FAULT
    require(failed == (ending.fault is not None), f"outcome {ending.outcome}, fault {ending.fault}")
    completed = ending.outcome is Outcome.COMPLETED
    require(completed or ending.reason, f"outcome {ending.outcome} without a reason")
    require(not (completed and ending.reason), f"completed, with a reason: {ending.reason}")
    try:
        canonical_json(dict(ending.telemetry))
    except (TypeError, ValueError) as error:
        raise CheckFailedError(f"the telemetry is not JSON: {error}") from None


def executes_together_what_it_does_alone(under_test: BackendUnderTest) -> None:
    """Each of several trials executed together has the samples it has alone, and its own ending."""
    with under_test.open() as backend:
        if not isinstance(backend, ExecutesTogether):
            return
        trial = under_test.possible
        fewest, most = backend.fewest_together, backend.most_together
        require(1 < fewest <= most, f"{fewest} to {most} trials together: there is no such number")
        require(
            backend.group(trial) == backend.group(trial.model_copy(update={"number": 2})),
            "group() of two trials that differ in their number only is not the same",
        )
        # Each has its own noise. The stop of the second trial must not affect the others.
        trials = [
            trial.model_copy(update={"number": number, "seed": trial.seed + number})
            for number in range(1, most + 1)
        ]
        alone = [_alone(backend, each) for each in trials]
        recorders = [StrictRecorder() for _ in trials]
        stops = [lambda place=place: place == 1 for place in range(most)]
        endings = list(backend.execute_together(trials, recorders, stops))
    places = sorted(place for place, _ in endings)
    require(places == list(range(most)), f"{most} trials, and the places of endings {places}")
    for place, ending in endings:
        if place == 1:
            stopped = ending.outcome is Outcome.INTERRUPTED
            require(stopped, f"a trial that was stopped ended as {ending.outcome}")
            continue
        whole = ending.outcome is Outcome.COMPLETED
        require(whole, f"beside a trial that was stopped, another one ended as {ending.outcome}")
        require(not recorders[place].order, "; ".join(recorders[place].order))
        _require_equal(alone[place], recorders[place].recording(ending))


def _alone(backend: Backend, trial: Trial) -> Recording:
    recorder = StrictRecorder()
    return recorder.recording(backend.execute(trial, recorder, lambda: False))


def _require_equal(alone: Recording, together: Recording) -> None:
    lengths = f"{len(together.time)} samples together, {len(alone.time)} alone"
    require(len(alone.time) == len(together.time), lengths)
    for name, channel in alone.channels.items():
        equal = channel.samples.tobytes() == together[name].tobytes()
        require(equal, f"{name}: its samples are not those of the trial alone")


def keeps_a_stop_from_outside(under_test: BackendUnderTest) -> None:
    """A stopped bench names the source of the stop; it moves only after that stop is cleared."""
    with under_test.open() as backend:
        if not isinstance(backend, SupportsExternalStop):
            text = "a way to stop it is given (stop_outside), but it cannot report a stop"
            require(under_test.stop_outside is None, text)
            return
        require(under_test.stop_outside, "it can be stopped from outside: stop_outside says how")
        require(backend.panic_stop() is None, "it is stopped before a stop was sent")
        _stopped_in_mid_trial(under_test, backend)
        first = _found(backend)
        _moves_nothing(under_test.possible, backend)
        backend.make_safe()
        _found(backend)  # make_safe() must not clear the stop
        _does_not_clear(backend, first.count + 1)
        _stop(under_test)
        _does_not_clear(backend, first.count)
        backend.clear_stop(_found(backend).count)
        require(backend.panic_stop() is None, "it is stopped after the stop was cleared")
        ending = backend.execute(under_test.possible, StrictRecorder(), lambda: False)
        text = f"after the stop was cleared, the trial ended as {ending.outcome}: {ending.reason}"
        require(ending.outcome is Outcome.COMPLETED, text)


def _stopped_in_mid_trial(under_test: BackendUnderTest, backend: Backend) -> None:
    recorder = StrictRecorder(lambda count: _stop(under_test) if count == 1 else None)
    ending = backend.execute(under_test.possible, recorder, lambda: False)
    message = f"a trial stopped from outside ended as {ending.outcome}, not as interrupted"
    require(ending.outcome is Outcome.INTERRUPTED, message)


def _moves_nothing(trial: Trial, backend: Backend) -> None:
    recorder = StrictRecorder()
    ending = backend.execute(trial, recorder, lambda: False)
    require(not recorder.blocks, f"{recorder.blocks} blocks were recorded on a stopped bench")
    message = f"a trial on a stopped bench ended as {ending.outcome}, not as interrupted"
    require(ending.outcome is Outcome.INTERRUPTED, message)


def _found(backend: SupportsExternalStop) -> PanicStop:
    stop = backend.panic_stop()
    if stop is None or not stop.by.strip():
        raise CheckFailedError(f"panic_stop() answered {stop!r} on a stopped bench")
    return stop


def _does_not_clear(backend: SupportsExternalStop, count: int) -> None:
    try:
        backend.clear_stop(count)
    except BackendError:
        _found(backend)
        return
    raise CheckFailedError(f"clear_stop({count}) cleared another stop than the latest")


def _stop(under_test: BackendUnderTest) -> None:
    if under_test.stop_outside is not None:
        under_test.stop_outside()
