"""A linear bench from plan to report: what people read is in m and N, and the numbers are right."""

from __future__ import annotations

import csv
import html
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import campaign as program
from campaign.api.analysis import analyse_run
from campaign.archive.reading.open_run import open_run
from campaign.backends.sim import BACKEND, SimOptions
from campaign.comparison.shared_systematics import shared_sources
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.protocol import load_protocol, make_plan
from campaign.recording import MemoryRecorder, Recording
from campaign.resources import protocols_folder
from campaign.trial import Trial
from tests.system.user import campaign

UNITS = r"(?<![\w/])[mµu]?rad(?!\w)|(?<![\w])deg(?!\w)|°|(?<!\w)[mk]?N[ ·]m(?!\w)|kg[ ·]m(?![a-z])"
WORDS = r"(?<![\w.\-/])(?:[Tt]orques?|[Aa]ngles?|[Ii]nertias?|[Aa]ngular)(?![\w\-]|\.\w)"
ROTARY = re.compile(f"{UNITS}|{WORDS}")
"""A unit or a word of a rotary axis; names of fields, columns and files stay, and are none."""
PHASES = re.compile(
    r"[−-]\s?(?:180|90) ?(?:°|deg)|[Pp]hase(?: of L)? \((?:°|deg)\)"
    r"|[Pp]hase margin(?: there)?(?: \(°\)(?: ± \(1σ\) \(°\))?|\s[\d.]+(?: ± [\d.]+)? °)"
    r"|(?<![\w.])[\d.]+°(?= |$)|, [\d.]+ deg, [\d.]+ dB|below 20 ?(?:°|deg)"
)
"""Angles of no axis."""
MOTOR = re.compile(r"torque constant(?: of the motor)?|N·m/A|N·m·s/m|rad/m\b|V·s/rad")
"""What a motor has that turns: its constants, and what is between it and the load."""


def told(text: str) -> str:
    return MOTOR.sub("", PHASES.sub("", text))


def rotary_in(text: str) -> list[str]:
    plain = told(text)
    return [plain[max(0, m.start() - 50) : m.end() + 30] for m in ROTARY.finditer(plain)]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The archive of the shipped linear bench's protocol, and its report."""
    folder = tmp_path_factory.mktemp("linear")
    # A fixed seed: of one direction in 40 chance makes residuals alike, a part of its own.
    done = campaign(folder, "run", "linear", "--report", "--set", "map.seed=3")
    assert not rotary_in(done.err)
    archive = folder / done.last_line
    return archive, archive.with_name(f"{archive.stem}-report")


@pytest.mark.slow
def test_the_page_has_nothing_of_a_rotary_axis(run: tuple[Path, Path]) -> None:
    text = (run[1] / "report.html").read_text(encoding="utf-8")
    text = text[: text.index('<section id="provenance">')]  # which quotes the files
    text = re.sub(r"<script.*?</script>|<style.*?</style>", "", text, flags=re.S)
    text = text.replace("<wbr>", "")  # where a name may break, and no space
    attributes = " ; ".join(re.findall(r'(?:aria-label|title|alt)="([^"]*)"', text))
    plain = html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text)))
    assert "Friction force (N)" in plain
    assert "mm/s" in plain
    assert not rotary_in(plain)
    assert not rotary_in(html.unescape(attributes))


def _told_by(tree: Any, phase: bool = False) -> Iterator[str]:
    """Texts of a report's data: units and sentences, but not keys and names."""
    if isinstance(tree, dict):
        names = [str(tree.get(key, "")) for key in ("name", "label", "quantity", "level")]
        if isinstance(tree.get("number"), dict):  # within a sentence
            names.append(tree["number"]["quantity"])
        phase = any("phase" in name.lower() or "180" in name for name in names)
        for key, value in tree.items():
            if key not in ("sources", "file", "key", "figure", "name", "parameters"):
                yield from _told_by(value, phase)
    elif isinstance(tree, list):
        for value in tree:
            yield from _told_by(value, phase)
    elif isinstance(tree, str) and not phase:
        yield tree


def test_neither_has_its_data(run: tuple[Path, Path]) -> None:
    tree = json.loads((run[1] / "report.json").read_text(encoding="utf-8"))
    texts = list(_told_by(tree))
    assert {"N", "m/s", "mm/s", "um"} <= set(texts)
    assert [each for text in texts for each in rotary_in(text)] == []


@pytest.mark.slow
def test_neither_have_its_tables_and_figures(run: tuple[Path, Path]) -> None:
    files = sorted((*run[1].glob("tables/*.csv"), *run[1].glob("figures/*.csv")))
    assert len(files) > 20
    for path in files:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if not any("phase" in c.lower() for c in row)]
        units = [row for row in rows if row[-2:] != ["Hz", "deg"]]  # figures of a phase over Hz
        assert not rotary_in("\n".join(" , ".join(row) for row in units)), path.name
    for path in run[1].glob("figures/*.svg"):
        text = path.read_text(encoding="utf-8")
        words = " ; ".join(re.findall(r"<(?:text|tspan|title|desc)[^>]*>([^<]*)<", text))
        assert not rotary_in(html.unescape(words)), path.name


@pytest.mark.slow
def test_neither_has_what_commands_print(run: tuple[Path, Path]) -> None:
    folder, name = run[0].parent.parent, run[0].stem
    for arguments in (
        ("plan", "linear"),
        ("show", name, "--metrics"),
        ("list",),
        ("check", "linear", "--output", "check.svg"),
    ):
        done = campaign(folder, *arguments)
        lines = [line for line in done.out.splitlines() if not re.match(r"(rate|torque)\t", line)]
        assert not rotary_in("\n".join(lines)), arguments


def test_metrics_and_recordings_are_archived_in_its_units(run: tuple[Path, Path]) -> None:
    opened = program.open(run[0])
    metrics = opened["map"].metrics
    assert set(metrics["unit"]) <= {"N", "m", "m/s", "m/s^2", "s", ""}
    trial = opened["map"].archived[1].recording()
    units = {name: channel.unit for name, channel in trial.channels.items()}
    assert units["relative_angle"] == "m"
    assert units["gyro_rate"] == "m/s"
    assert units["drive_torque"] == "N"
    assert units["motor_current"] == "A"


def test_the_numbers_are_those_of_the_bench(run: tuple[Path, Path]) -> None:
    """38 N of the guides and 0.016 N m of the screw, 2 pi / 10 mm times at the load: 48.05 N."""
    found = program.open(run[0])["map"].findings
    true = 38.0 + 0.016 * 2.0 * math.pi / 0.01
    coulomb = found[found["quantity"] == "coulomb_torque"]
    assert len(coulomb) >= 2
    assert np.allclose(coulomb["value"], true, rtol=5e-3)
    velocity = found[found["quantity"] == "stribeck_velocity"]
    assert np.allclose(velocity["value"], 4e-3, rtol=0.05)


def _executed(trial: Trial) -> Recording:
    recorder = MemoryRecorder()
    with BACKEND.open(SimOptions()) as backend:
        return recorder.recording(backend.execute(trial, recorder, lambda: False))


def as_rotary(bench: Bench) -> Bench:
    """The same SI numbers, of an axis that turns."""
    tree = bench.model_dump(mode="json")
    del tree["axis"]["kind"], tree["gear"]["lead"]
    return Bench.model_validate(tree, context={"si": True})


@pytest.mark.parametrize("test", ["breakaway", "step", "stabilization"])
def test_the_samples_are_those_of_a_rotary_axis_with_its_numbers(test: str) -> None:
    shipped = protocols_folder()
    protocol = load_protocol(shipped / "linear.toml", experiments(), shipped=shipped)
    plan = make_plan(protocol, only=[test], seed=3)
    linear = plan.trials[-1]
    bench = as_rotary(Bench.model_validate(linear.bench, context={"si": True}))
    rotary = linear.model_copy(update={"bench": bench.model_dump(mode="json")})
    one, other = _executed(linear), _executed(rotary)
    assert one.channels.keys() == other.channels.keys()
    assert len(one.time) > 1000
    for name, channel in one.channels.items():
        assert channel.samples.tobytes() == other.channels[name].samples.tobytes(), name
    assert one.channels["relative_angle"].unit == "m"
    assert other.channels["relative_angle"].unit == "rad"


@pytest.mark.slow
def test_the_page_of_a_trial_tells_settings_and_metrics_in_its_units(
    run: tuple[Path, Path], tmp_path: Path
) -> None:
    campaign(tmp_path, "report", str(run[0]), "--output", str(tmp_path / "r"), "--trials", "5")
    text = (tmp_path / "r" / "trials" / "trial-00005.html").read_text(encoding="utf-8")
    text = re.sub(r"<script.*?</script>|<style.*?</style>", "", text, flags=re.S)
    plain = html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text)))
    assert "axis: mass 27.9 kg" in plain
    assert "friction: load: coulomb force 38 N" in plain
    assert "friction: screw: coulomb torque 0.016 N·m" in plain
    own = re.sub(r"(?:friction: screw|motor|sensors: resolver): .*?(?= [a-z]+: )", "", plain)
    assert not rotary_in(re.sub(r"ripple: phase 0 °", "", own))


def test_what_shifts_two_runs_alike_is_called_as_its_estimates_call_it(
    run: tuple[Path, Path],
) -> None:
    (test,) = (each for each in analyse_run(open_run(run[0]), experiments()) if each.name == "map")
    told = {part.source for each in test.result.findings for part in each.known.systematic}
    assert shared_sources(test, test, {}, {}) == {"inertia", "torque constant"} == told
