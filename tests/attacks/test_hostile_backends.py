"""Backends of plug-ins that do what no backend may: the run ends in order, and says who it was.

A row is what the plug-in does at which call (`hostile.py`), and what has to come of it. All of them
are whole commands; those that this process would not survive have one of their own.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.errors import ExitCode
from campaign.execution.safety import NOT_SAFE
from campaign.recording import Fault, Outcome, SafeState
from tests.attacks.laboratory import PACKAGE, Done, Here, arguments, process
from tests.packages import Packages

DONE, FAULT, NOT_SEEN_SAFE = ExitCode.DONE, ExitCode.LIMIT_OR_FAULT, ExitCode.NOT_SAFE
INTERRUPTED = ExitCode.INTERRUPTED
FAULTY = (FAULT, NOT_SEEN_SAFE)
ANY = (DONE, *FAULTY)
soak = pytest.mark.soak


def seldom(*row: object) -> object:
    """A row that others stand for, but in a long run."""
    return pytest.param(*row, marks=soak)


def one_fault(done: Done, *codes: int) -> Done:
    """The first trial is a fault, and with it the run ended."""
    done.ended(*codes).sealed()
    assert done.run.status is RunStatus.FAULT
    [trial] = done.run.trials
    assert trial.ending.outcome is Outcome.FAULT
    return done


def bad_trial(done: Done, *codes: int) -> Done:
    """The first trial is a fault; whether others follow is the policy's business."""
    done.ended(*codes or FAULTY).sealed()
    assert done.run.trials[0].ending.outcome is Outcome.FAULT
    return done


# What execute raises and returns

RAISED = [
    ("sys.exit(0)", "SystemExit"),
    seldom("throw(SystemExit)", "SystemExit"),
    seldom("throw(SystemExit('no licence'))", "no licence"),
    ("throw(KeyboardInterrupt)", "KeyboardInterrupt"),
    ("throw(RoughError('rough'))", "RoughError: rough"),
    seldom("throw(GeneratorExit)", "GeneratorExit"),
    seldom("throw(StopIteration)", "StopIteration"),
    ("throw(ZeroDivisionError('a bug'))", "ZeroDivisionError: a bug"),
    seldom("throw(MemoryError)", "MemoryError"),
    ("throw(UnprintableError())", "UnprintableError"),
    seldom("throw(BaseExceptionGroup('two', [RoughError(), ValueError()]))", "BaseExceptionGroup"),
    ("recurse()", "RecursionError"),
]


@pytest.mark.parametrize(("do", "word"), RAISED)
def test_what_execute_raises_is_a_fault_of_the_plug_in(here: Here, do: str, word: str) -> None:
    done = one_fault(here.attacked("execute", do), FAULT).names_the_plug_in(word)
    assert word in done.run.trials[0].ending.reason
    assert done.run.safe_state is SafeState.CONFIRMED


def test_an_error_for_users_is_a_fault_as_well(here: Here) -> None:
    """It says itself what is wrong."""
    done = one_fault(here.attacked("execute", "throw(UsageError('no key'))"), FAULT)
    assert done.run.trials[0].ending.reason == "no key"


@pytest.mark.parametrize(("do", "word"), [RAISED[0], RAISED[3], RAISED[7]])
def test_so_it_is_of_one_that_moves_nothing(here: Here, do: str, word: str) -> None:
    one_fault(here.attacked("execute", do, "hostile_calm"), FAULT).names_the_plug_in(word)


@pytest.mark.parametrize("do", ["sys.exit(0)", "throw(KeyboardInterrupt)", "throw(ValueError)"])
def test_what_came_before_it_raised_is_kept(here: Here, do: str) -> None:
    done = one_fault(here.attacked("within", do), FAULT)
    assert len(done.run.trials[0].recording().time) == 20


def test_one_that_raises_whatever_it_is_asked_is_not_seen_safe(here: Here) -> None:
    done = one_fault(here.attacked("execute+make_safe+exit", "sys.exit(0)"), NOT_SEEN_SAFE)
    done.names_the_plug_in("SystemExit")
    assert done.run.safe_state is SafeState.NOT_CONFIRMED


@pytest.mark.parametrize(
    ("do", "word"),
    [
        ("None", "NoneType"),
        ("'completed'", "str"),
        seldom("{}", "dict"),
        seldom("Outcome.COMPLETED", "Outcome"),
        seldom("Ending", "type"),
        seldom("SimpleNamespace(outcome=Outcome.COMPLETED)", "SimpleNamespace"),
    ],
)
def test_what_execute_returns_has_to_be_an_ending(here: Here, do: str, word: str) -> None:
    one_fault(here.attacked("execute", do), FAULT).names_the_plug_in(word)


@pytest.mark.parametrize(
    "do",
    [
        "Ending(None)",
        seldom("Ending('done')"),
        "Ending(Outcome.FAULT, fault='drive')",
        seldom("Ending(Outcome.FAULT, fault=3)"),
        "Ending(Outcome.COMPLETED, safe_state=True)",
        seldom("Ending(Outcome.COMPLETED, safe_state=None)"),
        "Ending(Outcome.COMPLETED, telemetry=[1])",
        seldom("Ending(Outcome.COMPLETED, telemetry=None)"),
    ],
)
def test_an_ending_of_wrong_parts_is_a_fault(here: Here, do: str) -> None:
    bad_trial(here.attacked("ending", do)).names_the_plug_in()


@pytest.mark.parametrize(
    ("do", "word"),
    [
        ("None", "NoneType"),
        seldom("3", "int"),
        ("[(0, None), (1, None)]", "NoneType"),
        ("[('x', COMPLETED)]", "'x'"),
        seldom("[(7, COMPLETED)]", "7"),
        ("sys.exit(0)", "SystemExit"),
        ("(throw(SystemExit) for _ in '1')", "SystemExit"),
        seldom("(throw(KeyboardInterrupt) for _ in '1')", "KeyboardInterrupt"),
    ],
)
def test_executing_together_is_no_way_round(here: Here, do: str, word: str) -> None:
    done = here.attacked("together", do, "hostile_together").ended(FAULT).sealed()
    assert done.run.status is RunStatus.FAULT
    assert {each.ending.outcome for each in done.run.trials} == {Outcome.FAULT}
    assert PACKAGE in done.run.reason
    assert word in done.run.reason


# Making safe


@pytest.mark.parametrize("backend", ["hostile", seldom("hostile_calm")])
@pytest.mark.parametrize(
    ("do", "word"),
    [
        ("None", "NoneType"),
        seldom("True", "bool"),
        ("'confirmed'", "str"),
        seldom("SafeState", "EnumType"),
        ("throw(ZeroDivisionError('stuck'))", "ZeroDivisionError: stuck"),
        ("sys.exit(0)", "SystemExit"),
        ("throw(KeyboardInterrupt)", "KeyboardInterrupt"),
    ],
)
def test_only_a_safe_state_confirms_it(here: Here, do: str, word: str, backend: str) -> None:
    done = here.attacked("make_safe", do, backend).ended(NOT_SEEN_SAFE).sealed()
    assert done.run.safe_state is SafeState.NOT_CONFIRMED
    done.names_the_plug_in(word)
    assert done.run.trials[0].ending.outcome is Outcome.COMPLETED


@pytest.mark.parametrize("at", ["make_safe", "execute+make_safe", "within+make_safe"])
def test_one_that_hangs_is_not_waited_for(
    here: Here, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    """It hung the run for ever."""
    here.limit("MAKING_SAFE")
    impatient(monkeypatch)
    done = here.attacked(at, "hang()").ended(NOT_SEEN_SAFE).sealed()
    assert NOT_SAFE in done.err
    assert done.run.safe_state is SafeState.NOT_CONFIRMED
    done.names_the_plug_in("make_safe")


def test_a_trial_that_hangs_while_the_bench_is_made_safe_is_a_lost_connection(
    here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    impatient(monkeypatch)
    done = one_fault(here.attacked("within", "hang()"), FAULT)
    assert done.run.trials[0].ending.fault is Fault.LOST_CONNECTION


def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody is waited for long in a trial."""
    from campaign.cli import session
    from campaign.execution.supervision import Patience, Supervision

    patience = Patience(first=0.5, silence=0.5, closing=0.5, giving_up=0.2)
    monkeypatch.setattr(
        session,
        "Supervision",
        lambda *positional, **named: Supervision(*positional, **{"patience": patience, **named}),
    )


# Before anything moves

METHODS = ("refuses", "channels", "execute", "make_safe", "__enter__", "__exit__")


@pytest.mark.parametrize(
    ("do", "word"),
    [
        *((f"without({name!r})(options)", name) for name in METHODS),
        ("without('make_safe', 3)(options)", "make_safe"),
        ("without('panic_stop', base=Stoppable)(options)", "panic_stop"),
        ("None", "NoneType"),
        seldom("'text'", "str"),
        seldom("Hostile", ""),
        ("throw(ZeroDivisionError('opened'))", "ZeroDivisionError: opened"),
        ("sys.exit(0)", "SystemExit"),
    ],
)
def test_what_is_no_backend_is_refused(here: Here, do: str, word: str) -> None:
    backend = "hostile_stop" if "Stoppable" in do else "hostile"
    refused_by_name(here, here.attacked("open", do, backend).ended(FAULT), word)


def refused_by_name(here: Here, done: Done, word: str) -> None:
    """Nothing has moved, nothing is left, and it is said whose fault that is."""
    assert done.refused
    assert here.plug_in.EXECUTED == []
    done.names_the_plug_in(word)


@pytest.mark.parametrize(
    ("at", "do", "word"),
    [
        ("refuses", "throw(ZeroDivisionError('asked'))", "ZeroDivisionError: asked"),
        ("refuses", "sys.exit(0)", "SystemExit"),
        ("refuses", "3", "int"),
        seldom("refuses", "['task.mode']", "list"),
        ("refuses", "True", "bool"),
        ("refuses", "3 if calls > 2 else None", "int"),
        ("channels", "throw(ZeroDivisionError('asked'))", "ZeroDivisionError: asked"),
        ("channels", "sys.exit(0)", "SystemExit"),
        ("channels", "[1, 2]", "list"),
        seldom("channels", "3", "int"),
        ("channels", "'drive_torque gyro_rate'", "str"),
        ("channels", "None if calls < 2 else [1, 2]", "list"),
        ("enter", "throw(OSError('no such port'))", "no such port"),
        ("enter", "sys.exit(0)", "SystemExit"),
        ("enter", "throw(KeyboardInterrupt)", "KeyboardInterrupt"),
        ("enter+exit", "sys.exit(0)", "SystemExit"),
    ],
)
def test_what_it_answers_before_it_moves_is_looked_at(
    here: Here, at: str, do: str, word: str
) -> None:
    protocol = "ramps.toml" if at == "channels" else "moves.toml"
    done = here.attacked(at, do, protocol=protocol).ended(*FAULTY)
    refused_by_name(here, done, word)


@pytest.mark.parametrize("do", ["None", seldom("object()")])
def test_what_entering_returns_changes_nothing(here: Here, do: str) -> None:
    """A forgotten `return self` left a bench connected that nobody made safe."""
    here.attacked("enter", do).ended(DONE).sealed()


@pytest.mark.parametrize(
    ("at", "limit"), [("enter", "CONNECTING"), ("refuses", "LOOKING"), ("channels", "LOOKING")]
)
def test_one_that_hangs_before_it_moves_is_left(here: Here, at: str, limit: str) -> None:
    here.limit(limit)
    protocol = "ramps.toml" if at == "channels" else "moves.toml"
    done = here.attacked(at, "hang()", protocol=protocol).ended(*FAULTY)
    refused_by_name(here, done, "")


@pytest.mark.parametrize(
    ("do", "word"),
    [
        ("throw(ZeroDivisionError('held'))", "ZeroDivisionError: held"),
        ("sys.exit(0)", "SystemExit"),
        ("throw(KeyboardInterrupt)", "KeyboardInterrupt"),
    ],
)
@pytest.mark.parametrize("at", ["exit", "execute+exit"])
def test_letting_go_cannot_hide_what_was_measured(here: Here, at: str, do: str, word: str) -> None:
    done = here.attacked(at, do).ended(*FAULTY).sealed()
    for told in (PACKAGE, done.backend, word):
        assert told in done.err
    assert len(done.run.trials) == (2 if at == "exit" else 1)


def test_letting_go_that_hangs_is_left(here: Here) -> None:
    here.limit("LEAVING")
    done = here.attacked("exit", "hang()").ended(*FAULTY).sealed()
    assert PACKAGE in done.err
    assert done.run.status is RunStatus.COMPLETE


def test_letting_go_hides_no_exception(here: Here) -> None:
    """What `__exit__` returns counts for nothing."""
    do = "True if call == 'exit' else throw(ValueError('gone'))"
    one_fault(here.attacked("execute+exit", do), FAULT).names_the_plug_in("gone")


# Stopped from outside


@pytest.mark.parametrize(
    ("do", "word"),
    [
        ("throw(ZeroDivisionError('asked'))", "ZeroDivisionError: asked"),
        ("sys.exit(0)", "SystemExit"),
        ("'pressed'", "str"),
        ("True", "bool"),
    ],
)
def test_what_tells_of_a_stop_is_looked_at(here: Here, do: str, word: str) -> None:
    done = here.attacked("panic_stop", do, "hostile_stop").ended(*FAULTY)
    refused_by_name(here, done, word)


@pytest.mark.parametrize("do", ["throw(ZeroDivisionError)", "sys.exit(0)", "'pressed'", "True"])
def test_and_between_trials(here: Here, do: str) -> None:
    later = f"{do} if calls > 1 else None"
    done = here.attacked("panic_stop", later, "hostile_stop")
    done.ended(*FAULTY, INTERRUPTED).sealed()
    assert PACKAGE in done.err
    assert done.run.status is not RunStatus.COMPLETE


@pytest.mark.parametrize("calls", [0, 1])
def test_one_that_does_not_answer_is_not_waited_for(here: Here, calls: int) -> None:
    here.limit("LOOKING", 1.0)
    hangs = f"hang() if calls > {calls} else None"
    done = here.attacked("panic_stop", hangs, "hostile_stop").ended(*FAULTY, INTERRUPTED)
    assert PACKAGE in done.err
    assert done.refused if not calls else done.sealed()


@pytest.mark.parametrize("do", ["sys.exit(0)", "throw(ZeroDivisionError('told'))"])
def test_being_told_the_name_of_the_run_is_no_way_out(here: Here, do: str) -> None:
    refused_by_name(here, here.attacked("introduce", do, "hostile_stop").ended(*FAULTY), "")


# Texts


@pytest.mark.parametrize(
    "text", ["NASTY", "GARBAGE", *map(seldom, ("LONG", "None", "b'bytes'", "7"))]
)
@pytest.mark.parametrize(
    ("at", "do"),
    [
        ("ending", "fault({})"),
        ("within", "recorder.event(Event(0.1, {}))"),
        ("ending", "told(**{{'value': {}}})"),
        ("ending", "Ending(Outcome.COMPLETED, telemetry={{{}: 1}})"),
        ("execute", "throw(ValueError({}))"),
        ("execute", "throw(UsageError({}))"),
    ],
)
def test_no_text_keeps_a_run_from_being_sealed(here: Here, at: str, do: str, text: str) -> None:
    done = here.attacked(at, do.format(text)).ended(*ANY).sealed()
    assert len(str(done.run.trials[0].ending.reason)) < 1_100_000


@pytest.mark.parametrize("text", ["NASTY", "GARBAGE", seldom("LONG"), seldom("None")])
@pytest.mark.parametrize("field", ["label", "unit", "display_unit", "name"])
def test_nor_does_one_of_a_channel(here: Here, field: str, text: str) -> None:
    do = f"first({field}={text})"
    here.attacked("announced", do).ended(*ANY).sealed()


@pytest.mark.parametrize("text", ["NASTY", "GARBAGE", seldom("None")])
@pytest.mark.parametrize("calls", [0, 1])
def test_nor_does_who_stopped_it(here: Here, text: str, calls: int) -> None:
    do = f"PanicStop(1, {text}) if calls > {calls} else None"
    done = here.attacked("panic_stop", do, "hostile_stop").ended(*FAULTY, INTERRUPTED)
    assert done.refused if not calls else done.sealed()


@pytest.mark.parametrize("text", ["NASTY", seldom("LONG")])
def test_nor_does_a_refusal(here: Here, text: str) -> None:
    assert here.attacked("refuses", text).ended(ExitCode.USAGE, FAULT).refused


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at", "do"),
    [
        ("ending", "told(value=float('nan'))"),
        seldom("ending", "told(value=np.float64(1.0))"),
        seldom("ending", "told(value=np.arange(3))"),
        seldom("ending", "told(value={1: 2})"),
        ("ending", "told(value=10 ** 5000)"),
        seldom("ending", "told(value=deep(100_000))"),
        ("within", "recorder.event(Event(float('nan'), 'when'))"),
        seldom("within", "recorder.event(Event('soon', 'when'))"),
        ("within", "recorder.event('no event')"),
        ("within", "recorder.lost('abc')"),
        seldom("within", "recorder.lost(np.full(3, np.nan))"),
        ("within", "recorder.lost(np.zeros((2, 2)))"),
        ("announced", "first(own_rate='fast')"),
        seldom("announced", "first(own_rate=float('nan'))"),
        seldom("announced", "first(measured='yes')"),
    ],
)
def test_nor_does_what_is_no_value_for_json(here: Here, at: str, do: str) -> None:
    here.attacked(at, do).ended(*ANY).sealed()


# Channels

RATE = "relative_rate"
DEG = np.pi / 180


@pytest.mark.parametrize(
    ("unit", "value", "archived"),
    [
        ("deg/s", 30.0, 30.0 * DEG),
        ("rpm", 5.0, 5.0 * 2 * np.pi / 60),
        seldom("mrad/s", 500.0, 0.5),
        ("rad/s", 0.5, 0.5),
    ],
)
def test_a_unit_that_a_factor_leads_from_is_converted_once(
    here: Here, unit: str, value: float, archived: float
) -> None:
    """A rate of 30 deg/s was judged, and archived, as 30 rad/s."""
    do = f"first(unit={unit!r}) if call == 'announced' else column({value})"
    done = here.attacked("announced+value", do).ended(DONE).sealed()
    channel = done.run.trials[0].recording().channels[RATE]
    assert channel.unit == "rad/s"
    assert channel.samples == pytest.approx(archived, rel=1e-12)
    told = [event.text for event in done.run.trials[0].recording().events]
    assert any(unit in text for text in told) == (unit != "rad/s")
    assert any(RATE in line and unit in line for line in done.err.splitlines()) == (unit != "rad/s")


def test_the_limit_of_a_rate_is_judged_in_the_unit_that_it_has(here: Here) -> None:
    """60 deg/s are allowed."""
    do = "first(unit='deg/s') if call == 'announced' else column(90.0)"
    done = here.attacked("announced+value", do).ended(FAULT).sealed()
    assert done.run.trials[0].ending.outcome is Outcome.LIMIT
    assert done.run.trials[0].recording()[RATE] == pytest.approx([90 * DEG])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("do", "word"),
    [
        ("first(unit='furlong')", "furlong"),
        ("first(unit='A')", "relative_rate"),
        seldom("first(unit='')", "relative_rate"),
        seldom("first(unit='m/s')", "relative_rate"),
        seldom("first(unit='rad')", "relative_rate"),
        ("(*CHANNELS[:-1], replace(CHANNELS[-1], unit='K'))", "temperature"),
        ("first(name='gyro_rate')", "gyro_rate"),
        ("first(name='')", ""),
        ("first(name='a/b')", "a/b"),
        seldom("first(name='..')", ".."),
        ("first(name='\\ud800')", ""),
        ("tuple(replace(CHANNELS[0], name=f'c{n}') for n in range(10_000))", ""),
        ("()", "channel"),
        ("None", "NoneType"),
        seldom("7", "int"),
        ("['relative_rate']", "str"),
        seldom("{'relative_rate': 1}", "str"),
        ("(recorder.start(CHANNELS), CHANNELS)[1]", "second time"),
    ],
)
def test_channels_that_cannot_be_are_a_fault_before_anything_moves(
    here: Here, do: str, word: str
) -> None:
    done = bad_trial(here.attacked("announced", do))
    ended = done.run.trials[0]
    assert word in ended.ending.reason
    assert here.plug_in.STOPPED[0] is True
    assert len(ended.recording().time) == 0


@pytest.mark.parametrize(
    "do", ["first(name='time')", seldom("first(name=300 * 'x')"), seldom("first(name=' ')")]
)
def test_names_that_stand_for_something_else_are_archived_or_refused(here: Here, do: str) -> None:
    here.attacked("announced", do).ended(*ANY).sealed()


# Blocks

NO_BLOCKS = (
    "(time, block.astype(np.complex128))",
    "(time, np.ma.masked_array(block, mask=True))",
    "(time, block > 0)",
    "(time, block.astype(str))",
    "(time, block.astype(object))",
    "(time, block.astype('datetime64[s]'))",
    "(time, block[:-1])",
    "(time, block[:, :-1])",
    "(time, block.T)",
    "(time, block[..., np.newaxis])",
    "(time, np.float64(1.0))",
    "(time, None)",
    "(time, 'abc')",
    "(np.full(20, np.nan), block)",
    "(time - 0.2, block)",
    "(time[::-1], block)",
    "(np.float64(0.2), block)",
    "(np.full(20, np.inf), block)",
    "(time.astype(complex), block)",
    "(time > 0, block)",
    "(time.astype(str), block)",
    "(time.astype(object), block)",
    "(None, block)",
    "(None, None)",
)


@pytest.mark.slow
def test_a_block_that_is_none_is_a_fault_of_its_trial(here: Here) -> None:
    done = here.attacked_in_turn("samples", NO_BLOCKS).ended(FAULT).sealed()
    *spoilt, good = done.run.trials
    assert len(spoilt) == len(NO_BLOCKS)
    assert good.ending.outcome is Outcome.COMPLETED
    passed = [do for do, trial in zip(NO_BLOCKS, spoilt, strict=True) if not is_cut(trial)]
    assert passed == []


def is_cut(trial: ArchivedTrial) -> bool:
    """A fault of the recording, which ends with the last good sample or the one after that."""
    recording = trial.recording()
    values = [channel.samples for channel in recording.channels.values()]
    return (
        trial.ending.fault is Fault.RECORDING
        and 20 <= len(recording.time) <= 21
        and bool(np.isfinite(recording.time).all() and (np.array(values) == 0.01).all())
    )


def test_a_block_that_raises_is_one_of_the_plug_in(here: Here) -> None:
    done = bad_trial(here.attacked("samples", "(time, Liar())"), FAULT)
    assert len(done.run.trials[0].recording().time) == 20


NUMBERS = (
    "(time, np.zeros_like(block, dtype=int))",
    "(time, block.astype(np.float32))",
    "(time, block.astype('>f8'))",
    "(time.astype(np.float32), np.asfortranarray(block))",
    "(time.tolist(), block.tolist())",
)


def test_numbers_of_other_kinds_are_fine(here: Here) -> None:
    done = here.attacked_in_turn("samples", NUMBERS).ended(DONE).sealed()
    for trial in done.run.trials[1:]:
        values = trial.recording()[RATE]
        assert values == pytest.approx(0.01, rel=1e-6)
        assert len(values) == int(trial.trial.task.duration * 100)
    assert set(done.run.trials[0].recording()[RATE]) == {0.0, 0.01}


# The process that it shares with us


@pytest.mark.parametrize(
    ("at", "do"),
    [
        ("within", "os.umask(0o777)"),
        ("within", "os.chdir('/')"),
        ("within", "os.environ.clear()"),
        seldom("within", "sys.setswitchinterval(10.0)"),
        ("within", "setattr(threading, 'excepthook', throw)"),
        seldom("within", "warnings.simplefilter('error')"),
        seldom("enter", "(os.chdir('/'), self)[1]"),
        seldom("enter", "(os.umask(0o777), self)[1]"),
        seldom("enter", "(np.seterr(all='raise'), self)[1]"),
        ("make_safe", "(os.umask(0o777), os.chdir('/'), SafeState.CONFIRMED)[-1]"),
    ],
)
def test_what_it_does_to_the_process_moves_no_archive(here: Here, at: str, do: str) -> None:
    done = here.attacked(at, do).ended(DONE).sealed()
    assert done.run.status is RunStatus.COMPLETE
    if sys.platform != "win32":
        assert done.archive is not None
        assert done.archive.stat().st_mode & 0o777 == 0o644


@pytest.mark.slow
@pytest.mark.parametrize("at", ["open", "enter"])
def test_one_that_takes_the_signals_is_a_fault_or_has_no_success(here: Here, at: str) -> None:
    do = "(signal.signal(signal.SIGINT, signal.SIG_IGN), good)[1]"
    done = here.attacked(at, do).ended(DONE, *FAULTY)
    assert done.refused if done.code else done.sealed()


SPAM = "(print('SPAM: printed'), sys.stdout.write('SPAM: written\\n'))"


@pytest.mark.parametrize("backend", ["hostile", seldom("hostile_stop")])
def test_what_it_prints_is_not_ours(here: Here, backend: str) -> None:
    done = here.attacked("all", SPAM, backend).ended(DONE).sealed()
    assert all(f"SPAM: {what}" in done.err for what in ("printed", "written"))


# Processes of their own


def attacked_apart(packages: Packages, at: str, do: str, backend: str = "hostile") -> Done:
    return process(packages, arguments(at, do, backend, "moves.toml"))


@pytest.mark.slow
def test_standard_output_holds_the_path_and_nothing_else(apart: Packages) -> None:
    (apart.folder.parent / "spam").touch()
    done = attacked_apart(apart, "all", SPAM).ended(DONE).sealed()
    assert all(f"SPAM: {what}" in done.err for what in ("imported", "printed", "written"))
    shown = process(apart, ("verify", str(done.archive)))
    assert shown.code == DONE
    assert "SPAM" not in shown.out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at", "do", "code"),
    [
        ("execute", "sys.exit(0)", FAULT),
        seldom("ending", "fault(NASTY)", FAULT),
        seldom("execute", "throw(UnprintableError())", FAULT),
        seldom("make_safe", "threading.Event().wait(600)", NOT_SEEN_SAFE),
    ],
)
def test_a_process_of_its_own_ends_alike(apart: Packages, at: str, do: str, code: ExitCode) -> None:
    done = attacked_apart(apart, at, do).ended(code)
    assert done.archive is not None, done.err
    assert not done.partial
    assert process(apart, ("verify", str(done.archive))).code == DONE


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals and libraries of POSIX")
@pytest.mark.parametrize(
    "do",
    [
        "os._exit(0)",
        seldom("os.kill(os.getpid(), signal.SIGKILL)"),
        seldom("os.abort()"),
        seldom("ctypes.string_at(0)"),
        seldom("ctypes.PyDLL(None).sleep(600)"),  # it holds the lock: 30 s
    ],
)
def test_one_that_ends_the_program_is_not_seen_safe_and_its_run_goes_on(
    apart: Packages, do: str
) -> None:
    """`os._exit(0)` was a success without a word."""
    folder = apart.folder.parent
    (folder / "halt").touch()
    broken = attacked_apart(apart, "within", f"{do} if Path('halt').exists() else None")
    assert broken.code == NOT_SEEN_SAFE, broken.err
    assert NOT_SAFE in broken.err
    assert "campaign resume" in broken.err
    assert "Traceback" not in broken.err
    assert broken.archive is None
    [partial] = broken.partial
    (folder / "halt").unlink()
    process(apart, ("resume", str(partial.relative_to(folder)), "--yes")).ended(DONE).sealed()


@soak
def test_a_simulated_run_that_is_ended_has_no_guardian_and_goes_on(apart: Packages) -> None:
    """Nobody tells of its end; there is no path on standard output, and no sealed run."""
    folder = apart.folder.parent
    (folder / "halt").touch()
    do = "os._exit(0) if Path('halt').exists() else None"
    broken = attacked_apart(apart, "within", do, "hostile_calm")
    assert not broken.out
    assert broken.archive is None
    [partial] = broken.partial
    (folder / "halt").unlink()
    process(apart, ("resume", str(partial.relative_to(folder)))).ended(DONE).sealed()
