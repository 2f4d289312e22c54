"""The kit passes what keeps the interface, and fails what does not, each for its own reason."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from campaign.backends.sim import SimBackend, SimOptions
from campaign.errors import BackendError
from campaign.recording import Ending, Event, Outcome, SafeState
from campaign.testing import BackendUnderTest, CheckFailedError, backend_checks
from tests.experiments.laboratory import trials
from tests.physics.benches import bench
from tests.testing.fakes import CHANNELS, nan_at_the_end, renamed, under_test

CHECKS = backend_checks()


def sim() -> BackendUnderTest:
    (possible,) = trials("move", bench(), {"angle": "20 deg", "sample_rate": "500 Hz"})
    task = possible.task.model_copy(update={"compensation": "witchcraft"})
    return BackendUnderTest(
        open=lambda: SimBackend(SimOptions()),
        possible=possible,
        impossible=possible.model_copy(update={"task": task}),
        names="compensation",
    )


@pytest.mark.parametrize("name", CHECKS)
def test_the_simulated_bench_passes(name: str) -> None:
    CHECKS[name](sim())


@pytest.mark.parametrize("name", CHECKS)
def test_a_good_backend_passes(name: str) -> None:
    CHECKS[name](under_test())


def held(block: np.ndarray) -> np.ndarray:
    block[1] = np.repeat(block[1, ::10], 10)
    return block


@pytest.mark.parametrize("name", CHECKS)
def test_a_backend_with_a_slower_channel_that_it_does_not_name_passes(name: str) -> None:
    slower = (CHANNELS[0], replace(CHANNELS[1], own_rate=10.0))
    CHECKS[name](under_test(channels=slower, block=held, names=lambda names: None))


def refuses_when_asked_again() -> Callable[[object], str | None]:
    """As one does that thinks the first trial comes after the last one."""
    asked: list[object] = []

    def refuses(trial: object) -> str | None:
        asked.append(trial)
        return None if len(asked) % 2 else "it was asked before"

    return refuses


NOT_SAFE = SafeState.NOT_CONFIRMED
BROKEN: list[tuple[str, dict[str, Any], str]] = [
    ("accepts_a_possible_trial", {"refuses": lambda t: "no"}, "'no' of the possible trial"),
    (
        "accepts_a_possible_trial",
        {"refuses": refuses_when_asked_again()},
        "'it was asked before' of the possible trial, once connected",
    ),
    (
        "refuses_an_impossible_trial_naming_the_field",
        {"refuses": lambda t: None},
        "nothing against the impossible trial",
    ),
    (
        "refuses_an_impossible_trial_naming_the_field",
        {"refuses": lambda t: "cannot"},
        "does not name 'task.mode'",
    ),
    ("announces_channels_once_before_samples", {"announced": 2}, "announced twice"),
    ("announces_channels_once_before_samples", {"announced_first": False}, "samples came before"),
    ("announces_channels_once_before_samples", {"announced": 0, "samples": 0}, "no channel was"),
    (
        "announces_the_channels_it_names",
        {"names": lambda names: frozenset(names[:1])},
        r"named \['gyro_rate'\], and \['gyro_rate', 'motor_current'\] were",
    ),
    ("announces_the_channels_it_names", {"names": lambda names: frozenset()}, r"named \[\]"),
    (
        "holds_slower_channels",
        {"channels": (CHANNELS[0], replace(CHANNELS[1], own_rate=10.0))},
        "motor_current: 499 values at 10 Hz",
    ),
    (
        "holds_slower_channels",
        {"channels": (replace(CHANNELS[0], own_rate=200.0),)},
        "its own rate is 200 Hz of 100 Hz",
    ),
    ("describes_channels_in_known_units", {"channels": renamed("a", "a")}, "share a name"),
    ("describes_channels_in_known_units", {"channels": renamed("Rate (x)")}, "lower-case"),
    ("describes_channels_in_known_units", {"channels": renamed("time")}, "not 'time'"),
    (
        "describes_channels_in_known_units",
        {"channels": (replace(CHANNELS[0], label=" "),)},
        "no label",
    ),
    (
        "describes_channels_in_known_units",
        {"channels": (replace(CHANNELS[0], display_unit="kg"),)},
        "'kg' does not convert to 'rad/s'",
    ),
    ("appends_blocks_that_fit_the_channels", {"block": lambda b: b[:1]}, r"not \(channels, n\)"),
    ("appends_blocks_that_fit_the_channels", {"block": np.transpose}, r"not \(channels, n\)"),
    ("appends_blocks_that_fit_the_channels", {"block": np.float32}, "no array of float64"),
    ("appends_blocks_that_fit_the_channels", {"time": list}, "time is no array"),
    ("appends_blocks_that_fit_the_channels", {"time": lambda t: t[:, None]}, r"not \(n,\)"),
    ("appends_blocks_that_fit_the_channels", {"event": Event(0.1, "")}, "event without"),
    ("appends_blocks_that_fit_the_channels", {"event": Event(np.nan, "x")}, "event without"),
    ("keeps_the_promised_sample_times", {"time": lambda t: t + 1}, "sample 0 is at 1 s"),
    (
        "keeps_the_promised_sample_times",
        {"time": lambda t: t - t[0]},
        "sample 20 is at 0 s, not at 0.2 s",
    ),
    (
        "keeps_the_promised_sample_times",
        {"time": lambda t: t[::-1].copy()},
        "sample 0 is at 0.19 s",
    ),
    ("keeps_the_promised_sample_times", {"samples": 1}, "1 samples were recorded"),
    ("keeps_the_duration_without_gaps", {"samples": 400}, "400 samples in place of 500"),
    ("keeps_the_duration_without_gaps", {"block": nan_at_the_end}, "gyro_rate: 25 samples are"),
    ("keeps_the_duration_without_gaps", {"ending": Ending(Outcome.LIMIT, "l")}, "ended as limit"),
    ("ends_as_it_says", {"ending": None}, "not an Ending"),
    ("ends_as_it_says", {"ending": Ending(Outcome.COMPLETED, "well")}, "with a reason: well"),
    ("ends_as_it_says", {"ending": Ending(Outcome.LIMIT)}, "without a reason"),
    ("ends_as_it_says", {"ending": Ending(Outcome.COMPLETED, "", NOT_SAFE)}, "not confirmed"),
    (
        "ends_as_it_says",
        {"ending": Ending(Outcome.COMPLETED, telemetry={"latency_s": np.float32(1)})},  # type: ignore[dict-item]
        "telemetry is not JSON",
    ),
    ("ends_a_failing_trial_as_a_fault", {"failing": Ending(Outcome.FAULT, "hot")}, "fault None"),
    ("ends_a_failing_trial_as_a_fault", {"failing": Ending(Outcome.COMPLETED)}, "as completed"),
    ("ends_a_failing_trial_as_a_fault", {"failing_raises": BackendError("gone")}, "gone"),
    ("stops_in_mid_trial", {"heeds_stop": False}, "ended as completed"),
    (
        "stops_in_mid_trial",
        {"heeds_stop": False, "ending": Ending(Outcome.INTERRUPTED, "late")},
        "24 blocks came after the stop",
    ),
    ("stops_in_mid_trial", {"stopped_ending": Ending(Outcome.INTERRUPTED)}, "without a reason"),
    ("stops_in_mid_trial", {"safe": lambda n: NOT_SAFE}, "not confirmed after a stop"),
    ("stops_before_the_first_sample", {"heeds_stop": False}, "ended as completed"),
    (
        "stops_before_the_first_sample",
        {"heeds_stop": False, "ending": Ending(Outcome.INTERRUPTED, "late")},
        "25 blocks came",
    ),
    (
        "makes_safe_as_often_as_asked",
        {"safe": lambda n: NOT_SAFE if n == 1 else SafeState.CONFIRMED},
        r"make_safe\(\) before",
    ),
    (
        "makes_safe_as_often_as_asked",
        {"safe": lambda n: NOT_SAFE if n == 3 else SafeState.CONFIRMED},
        "again after",
    ),
    ("makes_safe_as_often_as_asked", {"safe": lambda n: None}, "answered None"),
    (
        "stops_no_other_trial",
        {"first_flag_only": True},
        "ended as interrupted and interrupted",
    ),
    ("passes_the_supervision", {"block": nan_at_the_end}, "as diverged: gyro_rate is nan at 0.19"),
    ("passes_the_supervision", {"time": lambda t: t - t[0]}, "fault: sample 20 is at 0 s instead"),
    ("passes_the_supervision", {"samples": 400}, "400 samples instead of 500"),
    ("passes_the_supervision", {"announced": 2}, "announced a second time"),
    ("passes_the_supervision", {"announced": 0}, "before the channels were announced"),
    ("passes_the_supervision", {"block": lambda b: b[:1]}, "a block has the shape"),
    (
        "is_ended_at_a_limit_and_made_safe",
        {"heeds_stop": False},
        "motor_current exceeded its limit; 24 blocks came after",
    ),
    (
        "is_ended_at_a_limit_and_made_safe",
        {"channels": renamed("a", "b")},
        "no limit can be watched",
    ),
    (
        "is_ended_at_a_limit_and_made_safe",
        {"safe": lambda n: NOT_SAFE},
        r"make_safe\(\) then did not answer CONFIRMED",
    ),
    ("is_ended_at_an_undefined_sample", {"heeds_stop": False}, "undefined; 24 blocks came after"),
    (
        "is_ended_when_its_time_stands_still",
        {"heeds_stop": False},
        "stood still; 24 blocks came after",
    ),
    ("hands_samples_over_in_time", {"block_size": 50}, "come 0.5 s at a time"),
    ("is_made_safe_while_it_hangs", {"gets_through": False}, "did not return within"),
    ("is_made_safe_while_it_hangs", {"safe": lambda n: NOT_SAFE}, "hung answered"),
    *(
        ("keeps_a_stop_from_outside", {"stoppable": True, **quirks}, message)
        for quirks, message in (
            ({"heeds_latch": False}, "stopped from outside ended as completed"),
            ({"tells": False}, r"panic_stop\(\) answered None"),
            ({"stopped_by": ""}, "on a stopped bench"),
            ({"safe_clears": True}, r"panic_stop\(\) answered None"),
            ({"clears_anything": True}, "cleared another stop than the latest"),
            ({"stays_off": True}, "is stopped after the stop was cleared"),
        )
    ),
    ("executes_twice", {"once": True}, "500 samples first, then 0"),
    ("lets_go_when_left", {"keeps_the_line": True}, "the line is taken"),
    ("lets_exceptions_pass", {"hides_exceptions": True}, "hides the exceptions"),
    ("records_what_can_be_archived", {"samples": 0}, "nothing was recorded"),
    ("records_what_can_be_archived", {"channels": renamed("a/b", "c")}, "cannot be archived"),
]


@pytest.mark.parametrize(("name", "quirks", "message"), BROKEN)
def test_a_broken_backend_fails(
    name: str, quirks: dict[str, Any], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "gets_through" in quirks:  # nothing is waited for that comes
        monkeypatch.setattr("campaign.testing.checks.PATIENCE", 0.5)
    with pytest.raises(CheckFailedError) as caught:
        CHECKS[name](under_test(**quirks))
    assert re.search(message, str(caught.value))


def test_every_check_can_fail() -> None:
    together = {"executes_together_what_it_does_alone"}  # see the last test
    assert {name for name, _, _ in BROKEN} | together == set(CHECKS)


@pytest.mark.slow
def test_the_kit_needs_no_test_framework() -> None:
    code = "import sys, campaign.testing; sys.exit('pytest' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


class Careless(SimBackend):
    """Executes together, with a mistake."""

    mistake = ""

    def group(self, trial: Any) -> Any:
        return trial.number if self.mistake == "group" else super().group(trial)

    def execute_together(self, trials: Any, recorders: Any, stops: Any) -> Any:
        if len(trials) > 1 and self.mistake == "stops":
            stops = [stops[1]] * len(stops)
        if len(trials) > 1 and self.mistake == "samples":
            trials = [t.model_copy(update={"seed": t.seed + t.number}) for t in trials]
            trials = [_heavier(t) for t in trials]
        for place, ending in super().execute_together(trials, recorders, stops):
            if not (len(trials) > 1 and self.mistake == "endings" and place == 2):
                yield place, ending


def _heavier(trial: Any) -> Any:
    axis = trial.bench["axis"]
    bench = {**trial.bench, "axis": {**axis, "inertia": axis["inertia"] * (1.0 + 1e-12)}}
    return trial.model_copy(update={"bench": bench})


@pytest.mark.parametrize(
    ("mistake", "said"),
    [
        ("group", "differ in their number only"),
        ("stops", "beside a trial that was stopped, another one ended as interrupted"),
        ("samples", "not those of the trial alone"),
        ("endings", r"places of endings \[0, 1, 3, 4,"),
    ],
)
def test_mistakes_of_a_backend_that_executes_together_are_found(mistake: str, said: str) -> None:
    careless = type("Careless", (Careless,), {"mistake": mistake})
    broken = replace(sim(), open=lambda: careless(SimOptions()))
    with pytest.raises(CheckFailedError, match=said):
        CHECKS["executes_together_what_it_does_alone"](broken)
