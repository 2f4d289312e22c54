"""`campaign identify` on recordings of a rig whose numbers are known here and nowhere else."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from campaign.cli.identify import _say, identify_run
from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode, ProtocolError, UsageError
from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation.gate import TOO_WIDE
from campaign.estimation.velocity_map import FORM
from campaign.experiments.analysis import suitable
from campaign.experiments.any_motion.inverse_fit import PRESLIDING
from campaign.experiments.any_motion.inverse_result import NO_SLOPE
from campaign.experiments.interface import Model
from campaign.identify import experiments_by_model
from campaign.identify.identification import Identification, _compared, _section, identify, widest
from campaign.identify.material import choose
from campaign.identify.page import CURES, _advice, next_measurement, write_identification
from campaign.identify.tables import parameter_unit, parameter_words, parameters_table
from campaign.parameter import Parameter, Unseen
from campaign.physics.bench import Bench
from campaign.protocol.problems import find_faults
from campaign.resources import templates_folder
from campaign.result import Finding
from tests.estimation.coverage import holds
from tests.estimation.rigs import Rig

PLAIN = ("inverse_dynamics",)


@pytest.fixture(scope="module")
def run(results: Path) -> str:
    return next(results.glob("*-rig-mapping.nxs")).stem


@pytest.fixture(scope="module")
def found(results: Path, run: str) -> Identification:
    return identify(
        choose(results, f"{run}:monday"),
        experiments_by_model(),
        models=PLAIN,
        validation=choose(results, f"{run}:tuesday"),
        compared=choose(results, f"{run}:worn"),
    )


@pytest.mark.slow
def test_parameters_hold_the_rig(found: Identification, rig: Rig) -> None:
    told = {each.estimate.name: each.estimate for each in found.parameters}
    for name in ("inertia", "coulomb_positive", "coulomb_negative"):
        assert holds(told[name], rig.truth[name]), name
        assert told[name].half_width < 0.2 * told[name].value
    assert told["inertia"].unit == "kg"  # of an axis that travels
    assert told["coulomb_positive"].unit == "N"


@pytest.mark.slow
def test_what_no_interval_has_in_it_is_told_beside_the_numbers(
    found: Identification, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A narrow interval beside a doubt of unknown size is no interval that holds."""
    (section,) = found.sections
    assert section.result is not None
    first, *rest = section.identified.parameters
    doubt = Systematic("friction, at this excitation")
    doubted = replace(first, estimate=replace(first.estimate, systematic=(doubt,)))
    own = replace(section.identified, parameters=(doubted, *rest))
    result = replace(
        section.result, key_numbers=(Finding.of(doubted.estimate, {}),), identified=own
    )
    told = replace(found, sections=(replace(section, result=result),))
    remark = "Not included in the intervals (size unknown): friction, at this excitation."
    page = write_identification(told, tmp_path / "page", templates_folder(), "campaign identify")
    assert remark in page.read_text(encoding="utf-8")
    _say(told)
    assert remark in " ".join(capsys.readouterr().out.split())


def test_unseen_motion_is_predicted(found: Identification) -> None:
    (section,) = found.sections
    assert section.result is not None
    [table] = [t for t in section.result.tables if t.key == "structures"]
    assert all(0.0 < row["validation"].value < 0.5 for row in table.rows)  # type: ignore[union-attr]


def test_what_to_measure_next_is_told_of_the_widest_interval(found: Identification) -> None:
    parameter = widest(found.parameters)
    assert parameter is not None
    share = 100.0 * parameter.estimate.half_width / abs(parameter.estimate.value)
    name = parameter_words(parameter.estimate.name)
    told = f"The widest interval is that of {name}: ± {share:.2g} % of it."
    assert told in next_measurement(found)
    nothing = replace(found, sections=())
    assert next_measurement(nothing) == ""


@pytest.mark.parametrize("source", [PRESLIDING, FORM])
def test_what_a_model_lacks_is_not_to_be_known_better(source: str) -> None:
    assert source in CURES


def test_what_is_open_for_another_reason_is_not_measured_next() -> None:
    def parameter(half: float, **more: Any) -> Parameter:
        return Parameter(Estimate("coulomb", 1.0, "N m", 1 - half, 1 + half, 0.95, **more), "")

    known, open_ = parameter(0.1), {"origin": Origin.NOT_DETERMINED}
    too_wide = parameter(0.6, reason=TOO_WIDE(percent=50.0), **open_)
    level = parameter(0.3, reason=NO_SLOPE(), **open_)
    assert widest([known, level]) is known
    assert widest([known, level, too_wide]) is too_wide


@pytest.mark.slow
def test_what_changed_is_declared_and_what_did_not_is_not(
    found: Identification, results: Path, run: str, rig: Rig
) -> None:
    (section,) = found.sections
    changes = {each.quantity: each for each in section.changes}
    worn = changes["coulomb_positive"]
    assert worn.adjusted is not None
    assert worn.adjusted < 0.05
    assert holds(worn.found.difference, 0.1 * rig.truth["coulomb_positive"])
    same = identify(
        choose(results, f"{run}:monday"),
        experiments_by_model(),
        models=PLAIN,
        compared=choose(results, f"{run}:tuesday"),
    ).sections[0]
    declared = [c for c in same.changes if c.adjusted is not None and c.adjusted <= 0.05]
    assert [each.quantity for each in declared] == []


def test_what_is_of_the_rig_cancels_between_its_runs(
    found: Identification, results: Path, run: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One torque constant of unknown truth shifts both runs alike."""
    first = found.sections[0].identified.parameters[0]
    parts = (Systematic("torque constant", 10.0, of_rig=True), Systematic("low-pass", 0.3))
    estimate = Estimate("inertia", 20.0, "kg m^2", 19.8, 20.2, 0.95, systematic=parts)
    assert found.sections[0].result is not None
    identified = replace(
        found.sections[0].identified, parameters=(replace(first, estimate=estimate),)
    )
    section = replace(
        found.sections[0], result=replace(found.sections[0].result, identified=identified)
    )
    monkeypatch.setattr("campaign.identify.identification.fitted_again", lambda *_: section)
    told = _compared(section, found.bench, choose(results, f"{run}:tuesday"), lambda _: None)
    (change,) = told.changes
    assert [part.source for part in change.found.difference.systematic] == ["low-pass"]


@pytest.mark.slow
def test_the_command_writes_a_page_its_data_and_a_bench(
    results: Path, run: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], rig: Rig
) -> None:
    bench = tmp_path / "identified.toml"
    page, code = identify_run(
        f"{run}:monday", results, models=PLAIN, bench=bench, page=tmp_path / "page"
    )
    assert code is ExitCode.DONE
    told, noted = capsys.readouterr()
    assert "inertia" in told
    assert re.search(r"\n  inverse_dynamics: .*axis\.inertia", noted.partition("bench: ")[2])
    html = page.read_text(encoding="utf-8")
    assert "deg" not in html.split("</style>")[1].replace("degrees", "")
    text = (page.parent / "identification.json").read_text(encoding="utf-8")
    data = json.loads(text)["content"]
    [method] = data["methods"]
    [mass] = [each for each in method["parameters"] if each["quantity"] == "inertia"]
    assert mass["low"] <= rig.truth["inertia"] <= mass["high"]
    assert data["digest"] == choose(results, run).run.identity
    text = bench.read_text(encoding="utf-8")
    assert "# the only one" in text
    tree = tomllib.loads(text)
    made = find_faults(Bench, {k: v for k, v in tree.items() if k != "schema"})
    assert isinstance(made, Bench)
    assert made.axis.inertia == pytest.approx(mass["value"], rel=1e-5)
    known = made.known.values["axis.inertia"]
    assert known.interval == pytest.approx((mass["low"], mass["high"]), rel=1e-4)
    assert made.known.identified is not None
    assert made.known.identified.digest == data["digest"]
    assert str(tmp_path) not in text + html


@pytest.mark.slow
def test_the_same_archive_gives_the_same_bytes(results: Path, run: str, tmp_path: Path) -> None:
    pages = [
        identify_run(f"{run}:monday", results, models=PLAIN, page=tmp_path / name)[0]
        for name in ("one", "two")
    ]
    one, two = (
        {p.relative_to(page.parent): p.read_bytes() for p in page.parent.rglob("*") if p.is_file()}
        for page in pages
    )
    assert one == two


@pytest.mark.parametrize(
    ("named", "more", "message"),
    [
        ("RUN:mondy", {}, "did you mean 'monday'"),
        ("RUN", {"models": ("inverse",)}, "there are "),
        ("RUN:monday", {"settings": ("inverse_dynamics.low_pas=3",)}, "low_pas"),
        ("RUN:monday", {"settings": ("low_pass=3",)}, "METHOD.option=value"),
        ("RUN:monday", {"settings": ('inverse_dynamics.low_pass="3 m"',)}, "low_pass"),
        (
            "RUN:monday",
            {"models": PLAIN, "settings": ('inverse_dynamics.terms=["inertai"]',)},
            "there is no term 'inertai'",
        ),
    ],
)
def test_mistakes_are_told(
    results: Path, run: str, tmp_path: Path, named: str, more: dict[str, object], message: str
) -> None:
    page = tmp_path / "page"
    with pytest.raises((UsageError, ProtocolError)) as told:
        identify_run(named.replace("RUN", run), results, page=page, **more)  # type: ignore[arg-type]
    assert message in str(told.value)
    assert not page.exists()


def test_a_page_takes_no_report_s_place(results: Path, run: str, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / ".campaign-report").write_text("a report\n", encoding="utf-8")
    (folder / "report.html").write_text("<p>mine", encoding="utf-8")
    with pytest.raises(UsageError, match=r"has no identification\.html"):
        identify_run(f"{run}:monday", results, models=PLAIN, page=folder)
    assert (folder / "report.html").read_text(encoding="utf-8") == "<p>mine"


def test_a_part_of_nothing_that_suits_is_told_with_reasons(
    results: Path, run: str, tmp_path: Path
) -> None:
    chosen = choose(results, f"{run}:monday")
    for name in experiments_by_model():
        trials, why = suitable(experiments_by_model()[name], ())
        assert not trials
        assert why
    assert chosen.trials


@pytest.mark.parametrize("option", ["validate", "compare"])
def test_a_run_is_not_held_against_itself(
    results: Path, run: str, tmp_path: Path, option: str
) -> None:
    with pytest.raises(UsageError, match=rf"--{option}.*fitted to"):
        identify_run(
            f"{run}:monday",
            results,
            models=PLAIN,
            page=tmp_path / "page",
            **{option: run},  # type: ignore[arg-type]
        )


@pytest.mark.slow
@pytest.mark.parametrize("option", ["validation", "compared"])
def test_a_recording_that_was_imported_twice_is_not_held_against_itself(
    results: Path, run: str, tmp_path: Path, option: str
) -> None:
    mapping = (results.parent / "rig-mapping.toml").read_text(encoding="utf-8")
    again = results.parent / "again.toml"
    again.write_text(mapping.replace("made up", "imported again"), encoding="utf-8")
    code = import_recordings([str(again)], tmp_path, only=("monday",))
    assert code is ExitCode.DONE
    other = choose(tmp_path, next(tmp_path.glob("*.nxs")).stem)
    one = choose(results, f"{run}:monday")
    assert one.run.identity != other.run.identity
    with pytest.raises(UsageError, match=r"the same samples as .*monday in trials"):
        identify(one, experiments_by_model(), models=PLAIN, **{option: other})  # type: ignore[arg-type]
    fresh = choose(results, f"{run}:tuesday")
    assert identify(fresh, experiments_by_model(), models=PLAIN, **{option: other}).parameters  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["page", "bench", "folder"])
def test_what_is_not_ours_is_told_before_anything_is_done(
    results: Path, run: str, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*args: object, **more: object) -> Identification:
        raise AssertionError

    monkeypatch.setattr("campaign.cli.identify.identify", never)
    page, bench = tmp_path / "page", tmp_path / "bench.toml"
    if kind == "page":
        page.mkdir()
        (page / "mine.txt").write_text("mine", encoding="utf-8")
    elif kind == "folder":
        bench.mkdir()
    else:
        bench.write_text('title = "a protocol"', encoding="utf-8")
    with pytest.raises(UsageError, match=r"no report of campaign|no bench|is a folder"):
        identify_run(f"{run}:monday", results, models=PLAIN, page=page, bench=bench)
    assert bench.is_dir() or not bench.exists() or "a protocol" in bench.read_text("utf-8")


def test_an_earlier_bench_is_replaced(results: Path, run: str, tmp_path: Path) -> None:
    bench, page = tmp_path / "bench.toml", tmp_path / "page"
    bench.write_text('name = "older"\n[axis]\nname = "x"\n', encoding="utf-8")
    identify_run(f"{run}:monday", results, models=PLAIN, page=page, bench=bench)
    assert "made up" in bench.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_bench_is_written_before_anything_is_printed(
    results: Path, run: str, found: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(text: str) -> None:  # as of `| head`
        raise BrokenPipeError

    monkeypatch.setattr("campaign.cli.identify.identify", lambda *a, **more: found)
    monkeypatch.setattr("campaign.cli.identify.print_line", closed)
    bench, page = tmp_path / "bench.toml", tmp_path / "page"
    with pytest.raises(BrokenPipeError):
        identify_run(f"{run}:monday", results, page=page, bench=bench)
    assert "axis" in tomllib.loads(bench.read_text(encoding="utf-8"))


@pytest.mark.parametrize("source", ["slow", "instruments", "loop"])
def test_what_makes_a_part_smaller_is_a_sentence(source: str) -> None:
    part = Systematic(source, 0.5)
    one = Estimate("viscous", 2.0, "N m s/rad", 1.9, 2.1, 0.95, systematic=(part,))
    assert f"({source})" in (told := _advice(Parameter(one, "")))
    assert "know the" not in told


def test_a_method_that_nothing_suits_is_counted_as_well() -> None:
    said: list[str] = []
    kind = replace(
        experiments_by_model()["ramps"],
        model=Model("ramps", "", suits=lambda trials: ((), "no trial")),
    )
    chosen = cast("Any", SimpleNamespace(name="run", trials=()))
    section = _section(kind, None, cast("Any", None), chosen, None, said.append)
    assert (section.problem, said) == ("no trial", ["ramps, run"])


def test_systematic_parts_are_in_the_unit_that_is_shown(found: Identification) -> None:
    table = parameters_table(found.sections)
    [row] = [each for each in table.rows if each["parameter"] == "delay"]
    [delay] = [each.estimate for each in found.parameters if each.estimate.name == "delay"]
    assert [part.source for part in delay.systematic] == ["band", "instruments"]
    sizes = [part.standard_uncertainty for part in delay.systematic]
    assert row["unit"] == "ms"
    band, held = (f"{1e3 * (size or 0.0):.2g}" for size in sizes)
    assert row["systematic"] == f"band {band}, instruments {held}"


def test_parameters_have_the_names_and_units_of_a_report(found: Identification) -> None:
    assert parameter_words("stribeck_velocity_negative") == "Stribeck velocity vs (negative)"
    assert parameter_words("coulomb_positive") == "coulomb positive"
    (section,) = found.sections
    for unit, shown in (("rad/s", "deg/s"), ("m/s", "mm/s"), ("N m", "N m")):
        assert parameter_unit(section, Estimate("stribeck_velocity", 0.5, unit)) == shown


@pytest.mark.slow
def test_the_first_table_of_the_page_is_the_first(results: Path, run: str, tmp_path: Path) -> None:
    page, _ = identify_run(f"{run}:monday", results, models=PLAIN, page=tmp_path / "page")
    html = page.read_text(encoding="utf-8").split("</style>")[1]
    assert re.findall(r"Table (\d+)", re.sub(r"<[^>]+>", "", html))[0] == "1"


@pytest.mark.slow
@pytest.mark.parametrize(("share", "warned"), [(0.33, False), (0.74, True), (float("nan"), True)])
def test_a_validation_that_the_model_does_not_predict_is_a_warning(
    found: Identification,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    share: float,
    warned: bool,
) -> None:
    """At the terminal, on the page and in the data, with its size."""
    (section,) = found.sections
    assert section.result is not None
    own = replace(section.identified, unseen=Unseen(share, "force"))
    result = replace(section.result, identified=own)
    told = replace(found, sections=(replace(section, result=result),))
    page = write_identification(told, tmp_path / "page", templates_folder(), "campaign identify")
    _say(told)
    text = f"validation residual (RMS): {100 * share:.2g} % of the measured force"
    written = (page.parent / "identification.json").read_text(encoding="utf-8")
    data = json.loads(written)["content"]
    said = " ".join(capsys.readouterr().err.split())
    for each in (said, page.read_text(encoding="utf-8"), str(data["methods"][0]["warnings"])):
        assert (text in each) is warned
    codes = [each["code"] for each in data["methods"][0]["warnings"]]
    assert codes == (["validation residual"] if warned else [])


def test_methods_that_validate_tell_what_they_leave(found: Identification) -> None:
    (section,) = found.sections
    assert section.result is not None
    assert section.identified.unseen is not None
    assert section.identified.unseen.what == "force"  # of an axis that travels
    [table] = [t for t in section.result.tables if t.key == "structures"]
    left = [row["validation"].value for row in table.rows]  # type: ignore[union-attr]
    assert section.identified.unseen.share in left
    assert section.identified.warnings == ()
