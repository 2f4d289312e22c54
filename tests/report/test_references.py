"""What a bench file states of numbers beside what a test found: whether friction has changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from campaign.errors import UsageError
from campaign.estimate import Estimate, Origin
from campaign.experiments.interface import Experiment, TestData
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import fingerprint
from campaign.protocol.problems import find_faults
from campaign.reason import Reason
from campaign.references.values import read_values
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
    rows = document.references.stated["breakaway"].table.rows
    assert [row["verdict"] for row in rows] == ["different", "no difference shown"]
    assert rows[0]["difference"].value == pytest.approx(2.4)
    (answer,) = document.opening.answers
    assert answer.prediction == (
        "1 of 2 numbers changed since they were identified: "
        "Coulomb friction Tc (direction positive) by +15 % (+12 to +18 %)"
    )
    assert "monday" in document.references.stated["breakaway"].table.note
    page, folder, _ = render(run, tmp_path, kinds, templates_folder())  # type: ignore[arg-type]
    assert answer.prediction in page
    assert "Identified before, and estimated now" in page
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
    (row,) = document.references.stated["breakaway"].table.rows
    assert (row["found"], row["verdict"]) == (findings[-1].known, "different")


def test_a_mean_stands_for_its_own_place_only(made_up: ModuleType, tmp_path: Path) -> None:
    """At the second preload there was one measurement, and no mean."""
    one = found("coulomb_torque", 17.0, 0.1, "N m")
    places = ({"preload": 1.0, "statistic": "mean"}, {"preload": 1.0, "measurement": 1})
    elsewhere = {"preload": 2.0, "measurement": 2}
    findings = [Finding.of(one, {**CONDITIONS, **each}) for each in (*places, elsewhere)]
    *_, document = analysed(made_up, tmp_path, findings=findings)
    rows = document.references.stated["breakaway"].table.rows
    assert ["preload 2" in str(row["conditions"]) for row in rows] == [False, True]


def test_what_nobody_identified_is_not_told_as_changed(made_up: ModuleType, tmp_path: Path) -> None:
    told = found("coulomb_torque", 18.4, 0.2, "N m")
    *_, document = analysed(made_up, tmp_path, told, rig=bench(origin="given"))
    said = document.opening.answers[0].prediction
    assert said.startswith("1 of 1 numbers differ from what the bench file states: Coulomb")
    assert document.references.stated["breakaway"].table.title == "Stated and estimated"
    assert "monday" not in document.references.stated["breakaway"].table.note


def test_what_was_said_of_another_bench_is_compared_with_nothing(
    made_up: ModuleType, tmp_path: Path
) -> None:
    """A test that sweeps friction, and a hand that edits it, leave the old interval behind."""
    stated = fingerprint(bench()).model_dump(mode="json")
    told = found("coulomb_torque", 18.4, 0.2, "N m")
    *_, same = analysed(made_up, tmp_path, told, rig=bench(fingerprint=stated))
    assert same.references.stated
    edited = bench(coulomb="18 N m", fingerprint=stated)
    *_, other = analysed(made_up, tmp_path, told, rig=edited)
    assert other.references.stated == {}


def test_a_number_without_interval_is_shown_and_not_judged(
    made_up: ModuleType, tmp_path: Path
) -> None:
    open_one = Estimate.without_interval(
        "coulomb_torque", 18.4, "N m", Reason("test", "a single run")
    )
    *_, document = analysed(made_up, tmp_path, open_one)
    (row,) = document.references.stated["breakaway"].table.rows
    assert row["verdict"] not in ("different", "no difference shown")
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
    assert document.references.stated == {}
    assert document.opening.answers[0].prediction == ""


VALUES = """quantity,value,unit,low,high,test,direction,preload [N mm]
coulomb_torque,16000,N mm,15800,16200,,positive,
coulomb_torque,16,N m,,,breakaway,positive,
inertia,2,kg m^2,1.95,2.05,,,
coulomb_torque,16,N m,15.8,16.2,,negative,
coulomb_torque,16,N m,15.8,16.2,,positive,1000
"""


def with_file(
    made_up: ModuleType, folder: Path, text: str, *told: Estimate, **more: Any
) -> tuple[Any, Document]:
    path = folder / "values.csv"
    path.write_text(text, encoding="utf-8")
    run, kinds, _ = analysed(made_up, folder, *told, rig=bench(known=False), **more)
    return run, document_of(run, kinds, files={path: read_values(path)})  # type: ignore[arg-type]


def test_a_file_of_values_is_compared_row_by_row(made_up: ModuleType, tmp_path: Path) -> None:
    told = (found("coulomb_torque", 18.4, 0.2, "N m"), found("inertia", 2.01, 0.05, "kg m^2"))
    _, document = with_file(made_up, tmp_path, VALUES, *told)
    (compared,) = document.references.files["breakaway"]
    first, bare, inertia = compared.table.rows
    assert first["stated"].value == pytest.approx(16.0)  # type: ignore[union-attr]
    assert first["difference"].value == pytest.approx(2.4)  # type: ignore[union-attr]
    assert [row["verdict"] for row in (first, inertia)] == ["different", "no difference shown"]
    assert "no interval" in str(bare["verdict"])
    assert document.opening.answers[0].references == (
        (
            "1 of 2 numbers differ from values.csv: "
            "Coulomb friction Tc (direction positive) by +15 % (+13 to +17 %)"
        ),
    )
    assert [each.split(":")[0] for each in document.references.problems] == [
        "values.csv, line 5",  # the other direction
        "values.csv, line 6",  # no preload is stated
    ]


def test_a_row_of_one_measurement_is_not_held_against_the_mean(
    made_up: ModuleType, tmp_path: Path
) -> None:
    singles = [
        Finding.of(found("coulomb_torque", 16.0 + n, 0.1, "N m"), {"measurement": n})
        for n in (1, 2)
    ]
    mean = Finding.of(found("coulomb_torque", 17.5, 0.1, "N m"), {"statistic": "mean"})
    text = "quantity,value,unit,measurement\ncoulomb_torque,16,N m,{}\n"
    for condition, expected in (("2", 18.0), ("", 17.5)):
        (tmp_path / f"{expected}").mkdir()
        _, document = with_file(
            made_up, tmp_path / f"{expected}", text.format(condition), findings=[*singles, mean]
        )
        (compared,) = document.references.files["breakaway"]
        (row,) = compared.table.rows
        assert row["found"].value == expected  # type: ignore[union-attr]


def test_what_other_numbers_say_is_shown_and_not_judged(
    made_up: ModuleType, tmp_path: Path
) -> None:
    """Two fits of the same points are no two numbers of a family."""
    one = found("coulomb_torque", 18.4, 0.2, "N m")
    fits = [Finding.of(one, {**CONDITIONS, "exponent": each}) for each in ("free", "2")]
    text = "quantity,value,unit,low,high\ncoulomb_torque,16,N m,15.8,16.2\n"
    _, document = with_file(made_up, tmp_path, text, findings=fits)
    (compared,) = document.references.files["breakaway"]
    assert [row["verdict"] for row in compared.table.rows] == [
        "different",
        "fits of the same points with the exponent held",
    ]
    assert compared.told.startswith("1 of 1 numbers differ")


def test_bench_and_file_are_one_family(made_up: ModuleType, tmp_path: Path) -> None:
    """Of three pairs a p value of 0.0135 is declared, of five it is not."""
    path = tmp_path / "values.csv"
    told = found("coulomb_torque", 16.555, 0.2, "N m")
    close = found("inertia", 2.02, 0.05, "kg m^2")
    text = "quantity,value,unit,low,high,test,direction\n{}"
    places = (",", "breakaway,", ",positive")  # of the same finding
    rows = {
        name: "".join(f"inertia,2.6,kg m^2,1,4,{place}\n" for place in places[:count])
        for name, count in (("three", 1), ("five", 3))
    }
    verdicts = {}
    for name, row in rows.items():
        path.write_text(text.format(row), encoding="utf-8")
        (tmp_path / name).mkdir()
        run, kinds, _ = analysed(made_up, tmp_path / name, told, close)
        document = document_of(run, kinds, files={path: read_values(path)})  # type: ignore[arg-type]
        first = document.references.stated["breakaway"].table.rows[0]
        verdicts[name] = first["verdict"]
    assert verdicts == {"three": "different", "five": "no difference shown"}


def test_files_stand_on_the_page_and_in_the_data(made_up: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "values.csv"
    path.write_text(VALUES, encoding="utf-8")
    run, kinds, _ = analysed(made_up, tmp_path, found("inertia", 2.4, 0.05, "kg m^2"))
    page, folder, report = render(
        run,  # type: ignore[arg-type]
        tmp_path,
        kinds,
        templates_folder(),
        references={path: read_values(path)},
    )
    assert "Reference values of values.csv, and found" in page
    assert "1 of 1 numbers differ from values.csv: inertia" in page
    assert "tables/breakaway-reference-values.csv" in folder.files
    assert any(each.startswith("values.csv, line 2") for each in report.problems)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: there is no column quantity, value, unit"),
        ("quantity;value;unit\n", "line 1: there is no column quantity, value, unit"),
        ("quantity,value,unit,unit\n", "line 1: 'unit' stands twice"),
        ("quantity,value,unit,f [Hz],f [rad/s]\n", "line 1: 'f' stands twice"),
        ("quantity,value,unit\n", "no row below"),
        ("quantity,value,unit\ninertia,2\n", "line 2: 2 cells; the first line has 3"),
        ("quantity,value,unit\n,2,kg m^2\n", "line 2: quantity is empty"),
        ("quantity,value,unit\ninertia,two,kg m^2\n", "line 2: value is a number, but 'two'"),
        ("quantity,value,unit\ninertia,1e308,kg m^2\n", "sizes from 1e-100 to 1e+100"),
        ("quantity,value,unit,\ninertia,2,kg m^2,3\n", "'3' stands in a column without a name"),
        (
            "quantity,value,unit,way\nf,2,N,up\nf,2,N,down\nf,3,N,up\n",
            "line 4: it repeats line 2",
        ),
        ("quantity,value,unit\ninertia,nan,kg m^2\n", "line 2: value is a number, but 'nan'"),
        ("quantity,value,unit\n\ninertia,2,furlong\n", "line 3: 'furlong' is not a unit"),
        ("quantity,value,unit,low,high\ninertia,2,kg m^2,1,\n", "low and high belong together"),
        ("quantity,value,unit,low,high\ninertia,2,kg m^2,3,4\n", "value lies between low and high"),
        ("quantity,value,unit,f [Hz]\ninertia,2,kg m^2,low\n", "f is a number, but 'low'"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "values.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError) as told:
        read_values(path)
    assert str(told.value).startswith(str(path))
    assert message in str(told.value)


def test_a_number_of_a_contradicted_model_is_not_judged(
    made_up: ModuleType, tmp_path: Path
) -> None:
    """Its interval is that of a curve that the data contradict."""
    wrong = replace(found("inertia", 2.4, 0.05, "kg m^2"), origin=Origin.CONTRADICTED)
    _, document = with_file(made_up, tmp_path, VALUES, wrong)
    (compared,) = document.references.files["breakaway"]
    assert ["contradict" in str(row["verdict"]) for row in compared.table.rows] == [True]
    assert compared.told == ""


def test_conditions_have_their_unit_and_their_kind(made_up: ModuleType, tmp_path: Path) -> None:
    """10 rad/s is no frequency of 10 Hz; true is no word."""
    one = found("torque", 2.0, 0.1, "N m")
    at = {"frequency": 10.0, "loaded": True}
    text = "quantity,value,unit,low,high,frequency [{}],loaded,\ntorque,2,N m,1.9,2.1,{},true,\n"
    for unit, value, matches in (("Hz", 10, True), ("kHz", 0.01, True), ("rad/s", 10, False)):
        (tmp_path / unit.replace("/", "")).mkdir()
        _, document = with_file(
            made_up,
            tmp_path / unit.replace("/", ""),
            text.format(unit, value),
            findings=[Finding.of(one, at)],
        )
        assert bool(document.references.files) is matches, unit
        assert bool(document.references.problems) is not matches


def test_a_test_that_there_is_not_is_named(made_up: ModuleType, tmp_path: Path) -> None:
    text = "quantity,value,unit,test\ninertia,2,kg m^2,breakway\n"
    _, document = with_file(made_up, tmp_path, text, found("inertia", 2.0, 0.1, "kg m^2"))
    assert document.references.problems == (
        "values.csv, line 2: there is no test breakway; there are breakaway",
    )


def test_a_number_beyond_a_bound_is_told(made_up: ModuleType, tmp_path: Path) -> None:
    least = Estimate("bandwidth", 20.0, "Hz", low=20.0, kind="at least")
    text = "quantity,value,unit,low,high\nbandwidth,11.8,Hz,11.7,11.9\n"
    _, document = with_file(made_up, tmp_path, text, least)
    (compared,) = document.references.files["breakaway"]
    assert [row["verdict"] for row in compared.table.rows] == ["beyond a bound"]
    assert compared.told == "1 number lies beyond a bound, of which no test is made"


def test_what_is_declared_is_in_the_words_of_the_picture(
    made_up: ModuleType, tmp_path: Path
) -> None:
    """Also where it has no change in percent, as its sign changes."""
    path = tmp_path / "values.csv"
    path.write_text(
        "quantity,value,unit,low,high\noffset,-1,N m,-1.1,-0.9\ninertia,2,kg m^2,1.95,2.05\n",
        encoding="utf-8",
    )
    told = (found("offset", 1.0, 0.1, "N m"), found("inertia", 2.01, 0.05, "kg m^2"))
    run, kinds, _ = analysed(made_up, tmp_path, *told)
    page, *_ = render(
        run,  # type: ignore[arg-type]
        tmp_path,
        kinds,
        templates_folder(),
        references={path: read_values(path)},
    )
    assert "Declared different: offset (direction positive)." in page
    assert page.count("Changes in percent") >= 2  # on its place, and in the list of figures
