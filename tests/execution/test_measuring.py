"""What a recording says by itself is measured when its trial ends, and archived with it."""

from __future__ import annotations

import hashlib
import json
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import campaign
from campaign.api.analysis import analyse_run
from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.journal import Decision
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.storage import CHUNK
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import SimBackend, SimOptions
from campaign.channels import LOAD_RATE
from campaign.cli.show import show_archive
from campaign.entry_points import PlugIn
from campaign.estimate import Estimate
from campaign.execution.runner import run_plan
from campaign.execution.stop import StopSwitch
from campaign.execution.trial_metrics import LIMIT, TrialMeasurement, author
from campaign.experiments import experiments
from campaign.experiments.friction_lag import cycle_windows
from campaign.experiments.interface import Experiment, TestData, TrialData, metrics
from campaign.plugins import Kinds
from campaign.report.build import render
from campaign.report.content.document import ANEW
from campaign.resources import templates_folder
from campaign.result import Finding, Result
from campaign.trial import Role, Trial
from tests.archives import archived
from tests.experiments.laboratory import MADE_UP, execute, trials
from tests.physics.benches import bench

Measures = Callable[[TrialData], Sequence[Estimate]]
SLIPS = {"stiffness": "200 N m/rad", "pull_rate": "0.1 rad/s", "duration": "3 s"}


def planned() -> list[Trial]:
    """Enough ramps for a batch, a recording of several chunks, and one of three windows."""
    rates = [f"{rate} N m/s" for rate in (200, 300, 500, 700, 1000)]
    long = {**SLIPS, "sample_rate": "20 kHz"}
    asked = [
        *trials("force_rate", bench(), {"torque_rates": rates}),
        *trials("stick_slip", bench(), long),
        *trials("friction_lag", bench(), {"frequencies": ["20 Hz"]}),
    ]
    return numbered(asked)


def numbered(asked: Sequence[Trial]) -> list[Trial]:
    return [trial.model_copy(update={"number": n}) for n, trial in enumerate(asked, start=1)]


def header_of(asked: Sequence[Trial]) -> RunHeader:
    tests = [{"name": name, "kind": name} for name in dict.fromkeys(t.kind for t in asked)]
    told = {"name": "2026-11-21T09-36-58-x", "created": "2026-11-21T09:36:58Z", "title": "x"}
    return RunHeader.model_validate(
        {**told, "protocol_name": "x", "backend": "sim"} | {"tests": tests}
    )


def run(folder: Path, asked: Sequence[Trial], limit: float = LIMIT) -> RunReader:
    """A sealed run, executed as the program does."""
    writer = RunWriter.create(folder, header_of(asked), asked)
    outcome = run_plan(
        asked, SimBackend(SimOptions()), writer, workers=1, display=lambda progress: None,
        stop=StopSwitch(), measure=TrialMeasurement(experiments(), limit=limit),
    )  # fmt: skip
    assert outcome.status is RunStatus.COMPLETE
    return open_run(outcome.archive)


def test_archived_metrics_are_those_of_the_archived_samples(tmp_path: Path) -> None:
    """Alone, in a batch, from one chunk and from several: equal to the last bit."""
    found = run(tmp_path, planned())
    assert len(found.trials) == 7
    assert len(found.trials[5].recording().time) > CHUNK
    for trial in found.trials:
        measure = experiments()[trial.trial.kind].measure
        assert measure is not None
        assert trial.estimates == tuple(measure(trial.unmeasured()))
        assert len(trial.estimates) >= 2
        assert all(math.isfinite(estimate.value) for estimate in trial.estimates)
        assert trial.measured_by == f"campaign {campaign.__version__}"
    assert found.problems() == []


def test_windows_are_archived_and_an_older_archive_without_them_measures_the_same(
    tmp_path: Path,
) -> None:
    (lag,) = execute(trials("friction_lag", bench(), {"frequencies": ["20 Hz"]}))
    old = lag.trial.model_copy(update={"windows": ()})
    reader = open_run(archived(tmp_path, [(old, lag.samples)]))
    experiment = experiments()["friction_lag"]
    options = experiment.options.model_validate(old.options, context={"si": True})
    new = run(tmp_path / "new", [lag.trial])
    assert new.trials[0].trial.windows == cycle_windows(options, 20.0)
    assert len(new.trials[0].trial.windows) == 3
    assert reader.trials[0].trial.windows == ()
    assert reader.trials[0].estimates == ()
    assert experiment.measure is not None
    assert tuple(experiment.measure(reader.trials[0])) == new.trials[0].estimates


# A kind whose `measure` changes from one day to the next


def top_rate(measure: Measures) -> Experiment:
    """The largest rate of a pull, as `measure` has it; its analysis only passes metrics on."""
    pull = experiments()["stick_slip"]

    def analyse(data: TestData) -> Result:
        found = [metrics(item, measure) for item in data.completed()]
        return Result(findings=tuple(Finding.of(each["top"], {}) for each in found))

    return Experiment("top_rate", "", pull.options, pull.trials, analyse, measure)


def scaled(factor: float) -> Measures:
    def measure(data: TrialData) -> tuple[Estimate, ...]:
        top = factor * float(np.max(data.recording()[LOAD_RATE]))
        return (Estimate("top", top, "rad/s", reason=MADE_UP()),)

    return measure


def run_of(
    folder: Path, measure: Measures, role: Role = Role.MEASUREMENT, limit: float = LIMIT
) -> RunReader:
    with experiments().including(top_rate(measure)):
        asked = [t.model_copy(update={"role": role}) for t in trials("top_rate", bench(), SLIPS)]
        return run(folder, asked, limit)


def value(reader: RunReader, measure: Measures, *, anew: bool = False) -> float:
    kinds = {"top_rate": top_rate(measure)}
    (test,) = analyse_run(reader, kinds, measure_anew=anew)
    assert not test.problem
    return test.result.findings[0].value


def test_code_of_tomorrow_leaves_results_of_today_alone(tmp_path: Path) -> None:
    today = run_of(tmp_path, scaled(1.0))
    found = value(today, scaled(1.0))
    assert value(today, scaled(3.0)) == found
    assert value(today, scaled(3.0), anew=True) == pytest.approx(3.0 * found)


def test_python_has_the_archived_metrics_and_can_do_without_them(tmp_path: Path) -> None:
    path = run_of(tmp_path, scaled(1.0)).path
    with experiments().including(top_rate(scaled(3.0))):
        then, now = campaign.open(path), campaign.open(path, measure_anew=True)
        assert then["top_rate"].findings["value"].item() == then["top_rate"].metrics["value"].item()
        ratio = now["top_rate"].findings["value"] / then["top_rate"].findings["value"]
    assert ratio.item() == pytest.approx(3.0)


def test_an_archive_without_metrics_is_measured_by_its_analysis(tmp_path: Path) -> None:
    (done,) = execute(trials("stick_slip", bench(), SLIPS))
    trial = done.trial.model_copy(update={"kind": "top_rate"})
    reader = open_run(archived(tmp_path, [(trial, done.samples)]))
    data = TestData("stick_slip", "top_rate", {}, reader.trials)
    (finding,) = top_rate(scaled(2.0)).analyse(data).findings
    assert finding.value == pytest.approx(2.0 * float(np.max(done.samples[LOAD_RATE])))


# What goes wrong costs no trial


def refusing(data: TrialData) -> Sequence[Estimate]:
    raise ValueError("the load never moved\nsecond line")


def broken(data: TrialData) -> Sequence[Estimate]:
    return [Estimate("x", float(data.recording()["no_such_channel"][0]), "")]


def crashing(data: TrialData) -> Sequence[Estimate]:
    raise RuntimeError("no such window")


def twice(data: TrialData) -> Sequence[Estimate]:
    return [Estimate("x", 1.0, ""), Estimate("x", 2.0, "")]


def why_not_measured(reader: RunReader) -> str:
    """The journal's reason; the trial itself is whole."""
    (trial,) = reader.trials
    assert (trial.estimates, trial.measured_by) == ((), "")
    assert len(trial.recording().time) == 3000
    (told,) = read_lines(reader.journal.encode()).all(Decision)
    assert (told.decision, told.trial) == ("no metrics", 1)
    assert verify_run(reader.path).sound
    return told.reason


@pytest.mark.parametrize(
    ("measure", "said"),
    [
        (refusing, "the load never moved"),
        (broken, "measuring failed: KeyError"),
        (crashing, "measuring failed: RuntimeError: no such window"),
        (twice, "'x' was measured twice"),
    ],
)
def test_what_cannot_be_measured_costs_no_trial(
    tmp_path: Path, measure: Measures, said: str
) -> None:
    reason = why_not_measured(run_of(tmp_path, measure))
    assert said in reason
    assert "second line" not in reason


def test_measuring_that_hangs_costs_no_trial(tmp_path: Path) -> None:
    released = threading.Event()

    def hangs(data: TrialData) -> Sequence[Estimate]:
        released.wait(60.0)
        return scaled(1.0)(data)

    try:
        reader = run_of(tmp_path, hangs, limit=0.2)
        assert not released.is_set()
    finally:
        released.set()
    assert why_not_measured(reader) == "measuring did not end within 0.2 s"


@pytest.mark.parametrize("plugged", [False, True])
def test_a_worker_needs_a_thread_for_plug_ins_only(
    plugged: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = []

    def measure(data: TrialData) -> Sequence[Estimate]:
        threads.append(threading.current_thread().name)
        return []

    plug_in = PlugIn("campaign.experiments", "top_rate", "tops", "1.0", "tops:IT", ("tops",))
    if plugged:
        monkeypatch.setattr(Kinds, "plug_in", lambda kinds, name: plug_in)
    (done,) = execute(trials("stick_slip", bench(), SLIPS))
    trial = done.trial.model_copy(update={"kind": "top_rate"})
    (recorded,) = open_run(archived(tmp_path, [(trial, done.samples)])).trials
    with experiments().including(top_rate(measure)):
        TrialMeasurement(experiments(), only_plug_ins=True)(recorded)
    assert threads == ["measuring" if plugged else threading.current_thread().name]


def test_a_recording_is_archived_before_it_is_measured(tmp_path: Path) -> None:
    """Whoever opens the run while it is measured finds it there, whole."""
    seen: list[int] = []

    def looks(data: TrialData) -> Sequence[Estimate]:
        (folder,) = tmp_path.glob("*.partial")
        assert verify_run(folder).sound
        (there,) = open_run(folder).trials
        seen.append(len(there.recording().time))
        return scaled(1.0)(data)

    (trial,) = run_of(tmp_path, looks).trials
    assert seen == [3000]
    assert [estimate.name for estimate in trial.estimates] == ["top"]


def test_what_was_not_found_is_left_out(tmp_path: Path) -> None:
    def measure(data: TrialData) -> Sequence[Estimate]:
        lost = Estimate.without_interval("lost", math.nan, "s", MADE_UP())
        return [lost, *scaled(1.0)(data)]

    reader = run_of(tmp_path, measure)
    assert [estimate.name for estimate in reader.trials[0].estimates] == ["top"]


def test_only_measurements_are_measured(tmp_path: Path) -> None:
    reader = run_of(tmp_path, refusing, Role.WARM_UP)
    assert reader.trials[0].estimates == ()
    assert not read_lines(reader.journal.encode()).all(Decision)


def test_a_plug_in_is_named_with_the_hash_of_its_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hash is of the file as it is, name and content: it changes with the content."""
    source = tmp_path / "coasting.py"
    monkeypatch.syspath_prepend(str(tmp_path))
    plug_in = PlugIn(
        "campaign.experiments", "coast", "coasting", "2.1", "coasting:EXPERIMENT", ("coasting",)
    )
    told = []
    for text in ("EXPERIMENT = 1\n", "EXPERIMENT = 2\n"):
        source.write_text(text, encoding="utf-8")
        content = f"coasting.py\0{len(text)}\0{text}".encode()
        expected = hashlib.sha256(content).hexdigest()
        told.append(author(plug_in))
        program = f"campaign {campaign.__version__}"
        assert told[-1] == f"coasting 2.1 (sha256 {expected}) with {program}"
    assert told[0] != told[1]


def test_the_page_says_who_measured(tmp_path: Path) -> None:
    reader = run_of(tmp_path, scaled(1.0))
    kinds = {"top_rate": top_rate(scaled(1.0))}
    for anew, said in ((False, f"campaign {campaign.__version__}"), (True, ANEW)):
        page, _, report = render(reader, reader.path, kinds, templates_folder(), measure_anew=anew)
        assert f"<dt>Each recording measured by</dt><dd>{said}</dd>" in page
        assert not report.problems


def test_show_lists_metrics_with_their_intervals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    found = Estimate("settling_time", 0.25, "s", 0.21, 0.29, 0.95, "made up")
    alone = Estimate("rise_time", 2.0, "s", reason=MADE_UP())
    run_of(tmp_path, lambda data: (found, alone))
    show_archive(None, tmp_path, as_json=False, metrics=True)
    words = capsys.readouterr().out
    assert "0.250 ± 0.040" in words
    assert MADE_UP.text in words
    show_archive(None, tmp_path, as_json=False)
    assert "settling_time" not in capsys.readouterr().out
    show_archive(None, tmp_path, as_json=True)
    (trial,) = json.loads(capsys.readouterr().out)["trials"]
    assert trial["metrics"][0]["high"] == 0.29
    assert trial["metrics"][1]["reason"] == MADE_UP.text
    assert trial["measured_by"] == f"campaign {campaign.__version__}"


def test_why_nothing_was_measured_is_told_in_the_words_of_the_axis() -> None:
    asked = {"positions": ["0 deg"], "directions": ["positive"], "peak_torque": "5 N m"}
    (done,) = execute(trials("breakaway", bench(), asked))
    linear = {"name": "carriage", "axis": {"name": "x", "kind": "linear", "inertia": 9.0}}
    moved = replace(done, trial=done.trial.model_copy(update={"bench": linear}))
    measuring = TrialMeasurement(experiments())
    assert "the rate never reached 0.2865 deg/s" in measuring(done).problem
    assert "the rate never reached 5 mm/s" in measuring(moved).problem
