"""A trial's own page: chosen by numbers, true of its samples, and there whatever became of it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import h5py
import numpy as np
import pytest

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.journal import Decision, TrialFinished
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.writer import RunWriter
from campaign.cli.report import report_run
from campaign.errors import ExitCode, UsageError
from campaign.estimate import Estimate, Window
from campaign.reason import Reason
from campaign.recording import (
    Channel,
    ChannelInfo,
    Ending,
    Event,
    Fault,
    Outcome,
    Recording,
    SafeState,
)
from campaign.report.build import Report
from campaign.report.content.settings import point_settings, settings_of, task_settings
from campaign.report.content.trial_account import _metric, _recorded
from campaign.report.content.trial_choice import chosen_trials, stretches
from campaign.report.drawing.drawing_files import LEGIBLE
from campaign.report.drawing.traces import (
    BOTTOM,
    FONT,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    Trace,
    draw_traces,
)
from campaign.report.page.names import trial_links
from campaign.report.page.trial_page import charts, legible
from campaign.report.palette import SERIES
from campaign.signals import MultiSine, Polyline, Sine
from campaign.trial import Task, Trial
from tests.html_pages import Page

pytestmark = pytest.mark.usefixtures("drawings_kept")

AT = "2026-11-21T09:36:58Z"
HOSTILE = "<script>alert(1)</script>\"'&"
RATE = ChannelInfo("gyro_rate", "rad/s", "Rate", "deg/s")
SPEED = ChannelInfo("relative_rate", "rad/s", f"Relative rate {HOSTILE}", "deg/s")
TORQUE = ChannelInfo("friction_torque", "N m", "Friction", "N m", measured=False)
TIME = np.arange(1000) / 100.0


@pytest.fixture(scope="module")
def made(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sealed run: a whole trial, one that failed midway, one that recorded nothing, one more."""
    bench = made_up.bench().model_dump(mode="json")
    task = Task(
        mode="rate",
        command=Sine(amplitude=math.radians(18), frequency=0.24),
        duration=10.0,
        window=(2.0, 10.0),
        sample_rate=100.0,
    )
    trials = [
        Trial(
            number=number,
            test="shake",
            kind="stabilization",
            seed=number,
            bench=bench,
            task=task,
            options={"frequency": 0.24, "acceleration": math.radians(18), "compensation": "none"},
            point={"compensation": "none"},
            note=HOSTILE if number == 1 else "",
            windows=(Window("measured", 4.0, 6.0),),
        )
        for number in (1, 2, 3, 4)
    ]
    header = RunHeader(
        name="run",
        created=AT,
        title="Shaking",
        tests=({"name": "shake", "kind": "stabilization", "title": "Shaken axis"},),
    )
    folder = tmp_path_factory.mktemp("made")
    writer = RunWriter.create(folder, header, trials)
    endings = {
        1: Ending(Outcome.COMPLETED),
        2: Ending(Outcome.LIMIT, f"current over {HOSTILE}", SafeState.CONFIRMED),
        3: Ending(Outcome.FAULT, "no word", SafeState.NOT_CONFIRMED, Fault.LOST_CONNECTION),
        4: Ending(Outcome.COMPLETED),
    }
    for trial in trials:
        recorder = writer.begin(trial)
        if trial.number != 3:
            recorder.start((RATE, SPEED, TORQUE))
            rate = np.radians(10 * np.sin(TIME))
            recorder.append(TIME, np.vstack([rate, -rate, np.full_like(TIME, 30.0)]))
            recorder.event(Event(5.0, HOSTILE))
        recorder.finish(endings[trial.number], AT, AT)
    return writer.seal(RunStatus.FAILED_TRIALS, ended=AT)


@pytest.fixture
def archive(made: Path, tmp_path: Path) -> Path:
    """A copy that a test may damage."""
    copy = tmp_path / made.name
    copy.write_bytes(made.read_bytes())
    return copy


def report(made_up: ModuleType, run: RunReader, output: Path, wanted: str, **more) -> Report:
    return made_up.build(run, output, trials=chosen_trials(run, wanted), **more)


def build(made_up: ModuleType, run: RunReader, output: Path, wanted: str, **more) -> Path:
    return report(made_up, run, output, wanted, **more).path.parent


@pytest.fixture(scope="module")
def folder(made_up: ModuleType, made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(made_up, open_run(made), tmp_path_factory.mktemp("pages") / "out", "all")


def page(folder: Path, number: int) -> Page:
    path = folder / "trials" / f"trial-{number:05d}.html"
    return Page(path.read_text(encoding="utf-8"))


# --- charts ---------------------------------------------------------------------------------


@pytest.mark.parametrize("with_angle", [True, False])
def test_a_rate_from_coarse_counts_is_drawn_filtered_and_says_so(with_angle: bool) -> None:
    """Unfiltered, it is a band of spikes one count per sample high, and hides the other lines."""
    time, count = np.arange(10_000) / 1e3, 2e-4
    true = 0.1 * np.sin(0.5 * np.pi * time)
    angle = count * np.round(-0.2 / np.pi * np.cos(0.5 * np.pi * time) / count)
    spiky = np.diff(angle, prepend=angle[0]) * 1e3
    channels = [
        Channel("gyro_rate", "rad/s", "Rate", "deg/s", true),
        Channel("relative_rate", "rad/s", "Relative rate", "deg/s", spiky),
    ]
    if with_angle:
        channels.append(Channel("relative_angle", "rad", "Relative angle", "deg", angle))
    recording = Recording(time, {each.name: each for each in channels})
    gyro, relative = charts(SimpleNamespace(recording=recording, windows=()))[0].keys
    assert gyro.filtered == ""
    assert relative.filtered.startswith("filtered, for its counts are coarse: ")
    drawn, _ = legible(recording, recording.channels["relative_rate"])
    known = np.isfinite(drawn)
    assert known.mean() > 0.98
    assert np.abs(spiky - true).max() > 0.09
    assert np.abs(drawn - true)[known].max() < (0.01 if with_angle else 0.03)
    # What is fine enough is drawn as it was recorded.
    fine = replace(recording.channels["relative_rate"], samples=true)
    plain = Recording(time, {fine.name: fine})
    assert legible(plain, fine) == (fine.samples, "")


# --- which trials ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ("", ()),
        ("all", tuple(range(1, 13))),
        ("failed", (4, 8, 12)),
        ("3", (3,)),
        ("3..5", (3, 4, 5)),
        ("5, 1..2,trial-00007", (1, 2, 5, 7)),
        ("failed,1", (1, 4, 8, 12)),
        ("12..12", (12,)),
    ],
)
def test_trials_are_chosen(made_up: ModuleType, tmp_path: Path, wanted, expected) -> None:
    assert chosen_trials(made_up.made_up_run(tmp_path), wanted) == expected


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("3..x", "--trials 3..x: 'x' is no number of a trial; write failed, all, N, N..M, or"),
        ("broken", "--trials broken: 'broken' is no number of a trial"),
        ("-1", "'-1' is no number of a trial"),
        ("1..", "--trials 1..: '' is no number of a trial"),
        ("1...3", "'.3' is no number of a trial"),
        ("5..3", "--trials 5..3: ends before it begins; write 3..5"),
        ("13", "--trials 13: there is no trial 13; executed in 2026-11-21T09-36-58-made-up: 1 to"),
        ("0", "there is no trial 0"),
        ("1..99999999999", "'99999999999' is no number of a trial"),
        ("1..9999999999", "there is no trial 9999999999"),
        (" , ", "names no trial; write failed"),
    ],
)
def test_what_is_no_trial_is_told_with_what_there_is(
    made_up: ModuleType, tmp_path: Path, wanted: str, message: str
) -> None:
    with pytest.raises(UsageError, match=re.escape(message)):
        chosen_trials(made_up.made_up_run(tmp_path), wanted)


def test_a_trial_that_was_not_executed_has_no_page(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path)
    stopped = replace(run, trials=run.trials[:2] + run.trials[4:6])
    assert chosen_trials(stopped, "1..12") == (1, 2, 5, 6)
    with pytest.raises(UsageError, match=r"trial 3 was not executed; .*: 1 to 2, 5 to 6$"):
        chosen_trials(stopped, "3")
    with pytest.raises(UsageError, match=r"none of these trials was executed"):
        chosen_trials(stopped, "3..4")
    with pytest.raises(UsageError, match=r"no trial of .* was executed"):
        chosen_trials(replace(run, trials=()), "1")


def test_many_stretches_are_told_shortly() -> None:
    assert stretches(range(1, 40, 2)) == "1, 3, 5, 7, 9, 11, 13, 15, …"
    assert stretches([4, 2, 3, 9]) == "2 to 4, 9"


def test_a_number_links_to_its_page_where_there_is_one() -> None:
    link = trial_links((3, 17))
    assert link(17) == "trials/trial-00017.html"
    assert link(4) is None


# --- the page -------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_report_links_to_them_and_is_otherwise_the_same(
    made_up: ModuleType, made: Path, folder: Path, tmp_path: Path
) -> None:
    whole = (folder / "report.html").read_text()
    plain = (build(made_up, open_run(made), tmp_path / "out", "") / "report.html").read_text()
    assert not (tmp_path / "out" / "trials").exists()
    linked = re.findall(r'<a href="(trials/[^"]+)">(\d)</a>', whole)
    assert linked == [(f"trials/trial-0000{n}.html", n) for n in ("2", "3")]
    assert re.sub(r'<a href="trials/[^"]+">(\d)</a>', r"\1", whole) == plain


def test_every_trial_has_its_page_and_each_leads_on(folder: Path) -> None:
    assert sorted(path.name for path in (folder / "trials").iterdir()) == [
        f"trial-0000{n}.html" for n in (1, 2, 3, 4)
    ]
    for number in (1, 2, 3, 4):
        links = [a["href"] for tag, a in page(folder, number).elements if tag == "a"]
        assert "../report.html#test-1" in links
        beside = {f"trial-0000{n}.html" for n in (number - 1, number + 1) if 1 <= n <= 4}
        assert {link for link in links if link.startswith("trial-")} == beside
        assert all(link.startswith(("#", "../report.html", "trial-")) for link in links)


def test_a_page_asks_nobody_and_obeys_nothing_in_it(folder: Path) -> None:
    for number in (1, 2, 3, 4):
        for tag, attributes in page(folder, number).elements:
            assert tag not in ("script", "iframe", "img", "object", "embed")
            assert not any(name.startswith("on") or name == "src" for name in attributes)
    assert HOSTILE in page(folder, 1).text
    assert "url(" not in (folder / "trials" / "trial-00001.html").read_text()


def test_it_says_what_was_set_in_units_people_read(folder: Path) -> None:
    words = page(folder, 1).text
    assert "Shaken axis: compensation none" in words
    assert "command sine of 18 deg/s, 0.24 Hz" in words
    assert "acceleration 18 deg/s²" in words
    assert "window 2 to 10 s" in words
    assert "motor: resistance" in words
    assert "0.314159" not in words
    assert "{" not in words.split("Settings")[1]
    assert re.search(r"limits: angle \d+ °", words)


def test_it_says_how_the_trial_ended(folder: Path) -> None:
    words = page(folder, 2).text
    assert f"Outcome limit: current over {HOSTILE}" in words
    assert "Safe state afterwards confirmed" in words
    lost = page(folder, 3).text
    assert "Fault lost-connection" in lost
    assert "Safe state afterwards not confirmed" in lost
    assert "It recorded no samples." in lost
    assert "<svg" not in (folder / "trials" / "trial-00003.html").read_text()


def test_channels_share_a_chart_by_unit(folder: Path) -> None:
    found = page(folder, 1)
    plots = [a["aria-label"] for tag, a in found.elements if a.get("class") == "plot"]
    assert plots == [f"deg/s over time: Rate, Relative rate {HOSTILE}", "N·m over time: Friction"]
    assert "Friction friction_torque (only a simulator knows it)" in found.text
    assert "Rate gyro_rate (only" not in found.text


def test_channels_are_drawn_in_the_unit_that_stands_there(folder: Path) -> None:
    text = (folder / "trials" / "trial-00001.html").read_text().split("</svg>")[0]
    ticks = re.findall(r'text-anchor="end">([^<]*)</text>', text)
    assert ticks == ["−10", "−5", "0", "5", "10"]  # of 10 deg/s, 0.17 rad/s


def test_windows_and_events_are_told(folder: Path) -> None:
    words = page(folder, 1).text
    assert "Shaded: measured, 4 to 6 s" in words
    assert f"Time (s) Event 5.000 {HOSTILE}" in words or f"Time (s) Event 5 {HOSTILE}" in words


def test_the_same_archive_gives_the_same_pages(
    made_up: ModuleType, made: Path, folder: Path, tmp_path: Path
) -> None:
    again = build(made_up, open_run(made), tmp_path / "out", "2..3")
    text = (again / "trials" / "trial-00002.html").read_text()
    first = (folder / "trials" / "trial-00002.html").read_text()
    before = ' · <a href="trial-00001.html" rel="prev">the trial before</a>'
    other = (first.replace(before, ""), text)
    assert other[0].replace("trial-00004", "trial-00003") == other[1]


def test_metrics_attempts_and_decisions_are_told(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ()})
    measured = (
        Estimate("largest_error", 0.00048, "rad", 0.00040, 0.00056, 0.95),
        Estimate("coulomb_torque", 30.0, "N m", reason=Reason("test", "read once")),
        Estimate("top_rate", math.radians(12), "rad/s", math.radians(11), math.radians(13), 0.95),
    )
    first = replace(run.trials[0], estimates=measured)
    lines = [
        TrialFinished(
            at=AT,
            trial=1,
            attempt=attempt,
            file="trial-00001.trial",
            sha256="0" * 64,
            record="1" * 64,
            bytes=1,
            outcome=Outcome.FAULT if attempt == 1 else Outcome.COMPLETED,
            reason="the cable" if attempt == 1 else "",
            safe_state=SafeState.CONFIRMED,
        )
        for attempt in (1, 2)
    ]
    decided = Decision(at=AT, trial=1, decision="retry", reason="a fault may be once")
    journal = "".join(f"{each.model_dump_json()}\n" for each in (*lines, decided))
    run = replace(run, trials=(first, *run.trials[1:]), story=read_lines(journal.encode()))
    words = page(build(made_up, run, tmp_path / "out", "1,2"), 1).text
    assert "largest error 0.480 ± 0.080 mrad" in words
    assert "coulomb torque 30 N·m read once" in words or "30.00 N·m read once" in words
    assert "top rate 12.0 ± 1.0 deg/s" in words
    assert f"1 {AT} fault the cable confirmed 2 {AT} completed" in words
    assert "retry a fault may be once" in words
    assert "Attempts" not in page(tmp_path / "out", 2).text


def test_a_damaged_channel_is_named_and_the_others_are_shown(
    made_up: ModuleType, archive: Path, tmp_path: Path
) -> None:
    with h5py.File(archive, "r+") as file:
        file["trial_00001/data/gyro_rate"][7] += 1e-9
    words = page(build(made_up, open_run(archive), tmp_path / "out", "1"), 1).text
    assert "This trial is damaged" in words
    assert "trial-00001, gyro_rate: " in words
    assert "does not match its checksum" in words
    assert "relative_rate" in words
    assert "Rate gyro_rate" not in words


def test_what_is_damaged_of_a_trial_with_a_page_is_in_the_notice(
    made_up: ModuleType, archive: Path, tmp_path: Path
) -> None:
    """Its page shows every channel, also those that no analysis reads."""
    with h5py.File(archive, "r+") as file:
        file["trial_00004/data/friction_torque"][7] += 1e-9
    without = report(made_up, open_run(archive), tmp_path / "without", "1")
    assert (without.damaged, without.notice) == ((), None)
    found = report(made_up, open_run(archive), tmp_path / "out", "1,4")
    assert [(each.trial, each.channel) for each in found.damaged] == [
        ("trial-00004", "friction_torque")
    ]
    assert found.notice is not None
    assert "trial-00004" in (tmp_path / "out" / "tables" / "damaged.csv").read_text()


def test_a_trial_that_cannot_be_read_has_a_page_that_says_so(
    made_up: ModuleType, archive: Path, tmp_path: Path
) -> None:
    with h5py.File(archive, "r+") as file:
        del file["trial_00004"]
    run = open_run(archive)
    assert chosen_trials(run, "failed") == (2, 3, 4)
    found = page(build(made_up, run, tmp_path / "out", "4"), 4)
    assert "This trial is damaged" in found.text
    assert "trial-00004: " in found.text
    assert not [tag for tag, _ in found.elements if tag == "svg"]


def test_a_laboratory_has_its_own_trial_page(
    made_up: ModuleType, made: Path, tmp_path: Path
) -> None:
    (tmp_path / "own").mkdir()
    text = '{% extends "campaign/trial.html" %}{% block settings %}<p>Ask us.</p>{% endblock %}'
    (tmp_path / "own" / "trial.html").write_text(text)
    run = open_run(made)
    found = page(build(made_up, run, tmp_path / "out", "1", templates=tmp_path / "own"), 1)
    assert "Ask us." in found.text
    assert "motor: resistance" not in found.text


def test_the_command_makes_them(made: Path, tmp_path: Path) -> None:
    path, code = report_run(str(made), tmp_path, tmp_path / "out", None, trials="failed")
    assert code == ExitCode.NO_RESULT  # made by hand, without the channel of its kind
    assert sorted(each.name for each in (path.parent / "trials").iterdir()) == [
        "trial-00002.html",
        "trial-00003.html",
    ]
    with pytest.raises(UsageError, match="there is no trial 5"):
        report_run(str(made), tmp_path, tmp_path / "no", None, trials="5")
    assert not (tmp_path / "no").exists()


# --- a chart --------------------------------------------------------------------------------

INSIDE = HEIGHT - BOTTOM - TOP
ACROSS = WIDTH - RIGHT - LEFT


def points(svg: str, css: str) -> list[list[tuple[float, float]]]:
    """The pieces of the line of a colour, in pixels."""
    (path,) = re.findall(rf'<path d="([^"]*)" fill="none" stroke="var\(--{css}\)"', svg)
    pieces = [piece for piece in path.split("M") if piece]
    return [
        [tuple(map(float, point.split())) for point in piece.split("L")]  # type: ignore[misc]
        for piece in pieces
    ]


def test_a_peak_of_one_sample_is_drawn_where_it_is() -> None:
    time = np.linspace(0.0, 100.0, 100_001)
    values = np.zeros_like(time)
    values[25_003], values[60_007] = 9.0, -1.0
    svg = draw_traces(time, [Trace("a", values, SERIES["lugre"])], "N")
    (line,) = points(svg, "s-lugre")
    assert len(line) <= 800
    top = TOP + INSIDE * 0.05 / 1.1  # a margin of 5 % of the span on either side
    assert min(line, key=lambda point: point[1]) == pytest.approx((LEFT + ACROSS / 4, top), abs=0.1)
    bottom = TOP + INSIDE * (1 - 0.05 / 1.1)
    assert max(line, key=lambda p: p[1]) == pytest.approx((LEFT + 0.6 * ACROSS, bottom), abs=0.1)


def test_lost_samples_are_a_gap() -> None:
    values = np.ones(100)
    values[40:60] = np.nan
    svg = draw_traces(np.arange(100.0), [Trace("a", values, SERIES["lugre"])], "N")
    first, second = points(svg, "s-lugre")
    assert (len(first), len(second)) == (40, 40)


def test_windows_are_shaded_where_they_are_and_no_farther() -> None:
    svg = draw_traces(
        np.linspace(0.0, 10.0, 11),
        [Trace("a", np.arange(11.0), SERIES["lugre"])],
        "N",
        [Window("in", 2.5, 5.0), Window("over", 7.5, 99.0)],
        [(5.0, "half"), (11.0, "later")],
    )
    found = re.findall(r'class="window" x="([\d.]+)" y="8" width="([\d.]+)"', svg)
    assert np.array(found, dtype=float) == pytest.approx(
        np.array([[LEFT + ACROSS / 4, ACROSS / 4], [LEFT + 0.75 * ACROSS, ACROSS / 4]]), abs=0.1
    )
    assert re.findall(r'class="moment" d="M([\d.]+) ', svg) == [f"{LEFT + ACROSS / 2:.1f}"]
    assert "in: 2.500 to 5 s" in svg or "in: 2.5 to 5 s" in svg


@pytest.mark.parametrize(
    "values", [np.empty(0), np.full(5, np.nan), np.zeros(5), np.full(5, 1e300)]
)
def test_there_is_a_chart_of_whatever_there_is(values: np.ndarray) -> None:
    time = np.arange(float(len(values)))
    svg = draw_traces(time, [Trace("a", values, SERIES["lugre"])], "N")
    assert "nan" not in svg
    assert "inf" not in svg


def test_a_constant_is_drawn_as_one() -> None:
    values = 30.0 + 1e-9 * np.sin(np.arange(100.0))
    (line,) = points(
        draw_traces(np.arange(100.0), [Trace("a", values, SERIES["fit"])], "N"), "s-fit"
    )
    assert np.ptp([y for _, y in line]) < 0.2


# --- settings in words ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            Sine(amplitude=math.radians(5), frequency=2.0, phase=math.pi / 2),
            "sine of 5 deg/s, 2 Hz, phase 90 °",
        ),
        (
            Polyline(times=(0.0, 1.0, 3.0), values=(0.0, math.radians(10), math.radians(-2))),
            "polyline of 3 points over 0 to 3 s, between −2 deg/s and 10 deg/s",
        ),
        (
            MultiSine(amplitudes=(0.1, math.radians(9)), frequencies=(0.5, 0.1), phases=(0, 0)),
            "2 sines of 0.1 to 0.5 Hz, the largest of 9 deg/s",
        ),
    ],
)
def test_a_motion_is_told_in_words(command, words: str) -> None:
    task = Task(mode="rate", command=command, duration=9.0, window=(0.0, 9.0), sample_rate=1e3)
    assert dict(task_settings(task, None))["command"] == words


def test_a_linear_axis_has_its_own_units() -> None:
    command = ChannelInfo("command", "m/s", "Commanded rate", "mm/s")
    sine = Sine(amplitude=0.005, frequency=1.0)
    task = Task(
        mode="rate",
        command=sine,
        base_acceleration=sine,
        stop_rate=0.1,
        duration=1.0,
        window=(0.0, 1.0),
        sample_rate=1e3,
    )
    told = dict(task_settings(task, command))
    assert told["command"] == "sine of 5 mm/s, 1 Hz"
    assert told["acceleration of the base"] == "sine of 5 mm/s², 1 Hz"
    assert told["stops at a rate of"] == "100 mm/s"


def test_every_number_of_a_bench_has_its_unit_or_none(made_up: ModuleType) -> None:
    told = dict(settings_of(made_up.bench()))
    assert told["axis: inertia"].endswith("kg·m²")
    assert told["motor: inductance"].endswith("H")
    assert not any("{" in text or "(SI)" in text for text in told.values())


def test_a_point_of_a_list_has_its_unit(made_up: ModuleType) -> None:
    bench = made_up.bench()
    options = made_up.ShakeOptions()
    point = {"frequency": 0.5, "bench.axis.inertia": 2.0, "odd": 0.1, "bench.nothing.here": 1}
    told = dict(point_settings(point, options, bench))
    assert told["frequency"] == "0.5 Hz"
    assert told["bench: axis: inertia"] == "2 kg·m²"
    assert told["odd"] == "0.1 (SI)"
    assert told["bench: nothing: here"] == "1"


def test_only_what_was_recorded_of_a_window_is_shaded() -> None:
    wanted = (Window("early", 0.0, 2.0), Window("cut", 4.0, 12.0), Window("late", 20.0, 30.0))
    windows, told = _recorded(wanted, Recording(TIME, {}))
    assert windows == (Window("early", 0.0, 2.0), Window("cut", 4.0, TIME[-1]))
    assert told == (
        "Not recorded to its end: cut, 4 to 12 s; the recording ends before.",
        "Not reached: late, 20 to 30 s; the recording ends at 9.99 s.",
    )
    assert _recorded((Window("whole", 2.0, 10.0),), Recording(TIME, {}))[1] == ()
    assert _recorded(wanted, None) == ((), ())


def test_a_share_of_the_time_is_told_in_percent() -> None:
    told = _metric(Estimate("time_stuck", 0.13, "", 0.12, 0.14, level=0.95))
    assert told["unit"] == "%"
    assert str(told["value"]).startswith("13")


def test_charts_scroll_rather_than_shrink_their_labels(folder: Path) -> None:
    sheets = [a for tag, a in page(folder, 1).elements if a.get("class") == "sheet"]
    assert sheets
    for sheet in sheets:
        least = int(re.fullmatch(r"--least: (\d+)px", sheet["style"])[1])
        assert FONT * least / WIDTH >= LEGIBLE


def test_a_page_says_that_a_window_was_not_reached(made_up, made: Path, tmp_path: Path) -> None:
    run = open_run(made)
    late = (Window("measured", 20.0, 30.0),)
    run = replace(run, trials=tuple(replace(each, windows=late) for each in run.trials))
    first = page(build(made_up, run, tmp_path / "out", "1"), 1)
    assert "Not reached: measured, 20 to 30 s; the recording ends at 9.99 s." in first.text
    assert "Shaded:" not in first.text
    assert not any(a.get("class") == "window" for _, a in first.elements)
