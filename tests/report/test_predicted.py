"""What a bench file states of numbers beside what a test found: whether friction has changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from campaign.estimate import Estimate
from campaign.experiments.interface import Experiment, TestData
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import fingerprint
from campaign.protocol.problems import find_faults
from campaign.reason import Reason
from campaign.report.build import render
from campaign.report.content.document import Document, document_of
from campaign.resources import templates_folder
from campaign.result import Finding, Result

pytestmark = pytest.mark.usefixtures("drawings_kept")

CONDITIONS = {"direction": "positive"}


def bench(
    known: bool = True, origin: str = "measured", coulomb: str = "16 N m", **more: Any
) -> Bench:
    values = {
        "friction.load.coulomb_torque": {"standard_uncertainty": "0.2 N m", "origin": origin},
        "axis.inertia": {"standard_uncertainty": "0.1 kg m^2", "origin": origin},
    }
    made = find_faults(
        Bench,
        {
            "name": "rig",
            "axis": {"name": "tilt", "inertia": "2 kg m^2"},
            "friction": {
                "load": {
                    "model": "stribeck",
                    "coulomb_torque": coulomb,
                    "static_torque": "20 N m",
                    "stribeck_velocity": "0.03 rad/s",
                    "viscous_friction": "4 N m s/rad",
                }
            },
            "known": {
                "values": values if known else {},
                "identified": {
                    "run": "monday",
                    "digest": "d1",
                    "program": "campaign",
                    "command": "campaign identify monday",
                },
                **more,
            },
        },
    )
    assert isinstance(made, Bench), made
    return made


def found(name: str, value: float, half: float, unit: str) -> Estimate:
    return Estimate(name, value, unit, value - half, value + half, 0.95)


def analysed(
    made_up: ModuleType,
    folder: Path,
    *told: Estimate,
    findings: Sequence[Finding] = (),
    rig: Bench | None = None,
    **header: object,
) -> tuple[object, dict[str, Experiment], Document]:
    findings = (*findings, *(Finding.of(each, CONDITIONS) for each in told))

    def analyse(data: TestData) -> Result:
        return Result(findings=findings)

    facts = {"backend": "serial", **header}
    run = made_up.made_up_run(folder, tests={"breakaway": ()}, bench=rig or bench(), **facts)
    kind = Experiment("breakaway", "", made_up.ShakeOptions, lambda options, bench: (), analyse)
    kinds = {"breakaway": kind}
    return run, kinds, document_of(run, kinds)


def test_what_has_changed_is_named_with_its_size(made_up: ModuleType, tmp_path: Path) -> None:
    run, kinds, document = analysed(
        made_up,
        tmp_path,
        found("coulomb_torque", 18.4, 0.2, "N m"),
        found("inertia", 2.01, 0.05, "kg m^2"),
    )
    rows = document.predictions["breakaway"].table.rows
    assert [row["verdict"] for row in rows] == ["differs", "no difference shown"]
    assert rows[0]["difference"].value == pytest.approx(2.4)
    (answer,) = document.opening.answers
    assert answer.prediction == (
        "1 of 2 numbers changed since they were identified: "
        "Coulomb friction Tc (direction positive) by +15 % (+12 to +18 %)"
    )
    assert "monday" in document.predictions["breakaway"].table.note
    page, folder, _ = render(run, tmp_path, kinds, templates_folder())  # type: ignore[arg-type]
    assert answer.prediction in page
    assert "Identified before, and found now" in page
    assert "tables/breakaway-stated.csv" in folder.files


def test_what_agrees_is_not_called_the_same(made_up: ModuleType, tmp_path: Path) -> None:
    *_, document = analysed(made_up, tmp_path, found("coulomb_torque", 16.2, 0.2, "N m"))
    (answer,) = document.opening.answers
    assert answer.prediction == (
        "1 number does not differ from what was identified, as far as the intervals show"
    )


def test_of_repeated_measurements_the_mean_is_judged(made_up: ModuleType, tmp_path: Path) -> None:
    """Each of them could be the stated 16 N m; all of them together cannot."""
    singles = [found("coulomb_torque", 17.0, 1.5, "N m") for _ in range(8)]
    mean = found("coulomb_torque", 17.0, 0.1, "N m")
    findings = [
        Finding.of(each, {**CONDITIONS, "measurement": n})
        for n, each in enumerate(singles, start=1)
    ]
    findings.append(Finding.of(mean, {**CONDITIONS, "statistic": "mean"}))
    *_, document = analysed(made_up, tmp_path, findings=findings)
    (row,) = document.predictions["breakaway"].table.rows
    assert (row["found"], row["verdict"]) == (findings[-1].known, "differs")


def test_a_mean_stands_for_its_own_place_only(made_up: ModuleType, tmp_path: Path) -> None:
    """At the second preload there was one measurement, and no mean."""
    one = found("coulomb_torque", 17.0, 0.1, "N m")
    places = ({"preload": 1.0, "statistic": "mean"}, {"preload": 1.0, "measurement": 1})
    elsewhere = {"preload": 2.0, "measurement": 2}
    findings = [Finding.of(one, {**CONDITIONS, **each}) for each in (*places, elsewhere)]
    *_, document = analysed(made_up, tmp_path, findings=findings)
    rows = document.predictions["breakaway"].table.rows
    assert ["preload 2" in str(row["conditions"]) for row in rows] == [False, True]


def test_what_nobody_identified_is_not_told_as_changed(made_up: ModuleType, tmp_path: Path) -> None:
    told = found("coulomb_torque", 18.4, 0.2, "N m")
    *_, document = analysed(made_up, tmp_path, told, rig=bench(origin="given"))
    said = document.opening.answers[0].prediction
    assert said.startswith("1 of 1 numbers differ from what the bench file states: Coulomb")
    assert document.predictions["breakaway"].table.title == "Stated by the bench, and found"
    assert "monday" not in document.predictions["breakaway"].table.note


def test_what_was_said_of_another_bench_is_compared_with_nothing(
    made_up: ModuleType, tmp_path: Path
) -> None:
    """A test that sweeps friction, and a hand that edits it, leave the old interval behind."""
    stated = fingerprint(bench()).model_dump(mode="json")
    told = found("coulomb_torque", 18.4, 0.2, "N m")
    *_, same = analysed(made_up, tmp_path, told, rig=bench(fingerprint=stated))
    assert same.predictions
    edited = bench(coulomb="18 N m", fingerprint=stated)
    *_, other = analysed(made_up, tmp_path, told, rig=edited)
    assert other.predictions == {}


def test_a_number_without_interval_is_shown_and_not_judged(
    made_up: ModuleType, tmp_path: Path
) -> None:
    open_one = Estimate.without_interval(
        "coulomb_torque", 18.4, "N m", Reason("test", "a single run")
    )
    *_, document = analysed(made_up, tmp_path, open_one)
    (row,) = document.predictions["breakaway"].table.rows
    assert row["verdict"] not in ("differs", "no difference shown")
    assert document.opening.answers[0].prediction == ""


@pytest.mark.parametrize(
    ("rig", "header"),
    [
        (bench(known=False), {}),  # nobody said how well it is known
        (bench(), {"backend": "sim"}),  # its samples come from that very bench
    ],
)
def test_nothing_is_held_against_nothing(
    made_up: ModuleType, tmp_path: Path, rig: Bench, header: dict[str, object]
) -> None:
    told = found("coulomb_torque", 18.4, 0.2, "N m")
    *_, document = analysed(made_up, tmp_path, told, rig=rig, **header)
    assert document.predictions == {}
    assert document.opening.answers[0].prediction == ""
