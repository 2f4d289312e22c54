"""A recording can be imported as the experiment that identifies from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from campaign.api.analysis import analyse_run
from campaign.archive.reading.open_run import open_run
from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode, ProtocolError
from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.breakaway.experiment import BreakawayOptions
from campaign.experiments.interface import Experiment, Model, TestData, metrics
from campaign.experiments.shared.recorded_motion import nothing_to_plan, of_any_motion
from campaign.identify import experiments_by_model
from campaign.identify.identification import identify
from campaign.identify.material import choose
from campaign.options import Options
from campaign.parameter import IdentifiedRig, Parameter
from campaign.reason import Cause
from campaign.result import Result
from tests.estimation.rigs import Rig
from tests.experiments.laboratory import Done, execute
from tests.experiments.laboratory import trials as planned
from tests.identify import conftest as rig_files
from tests.physics.benches import bench

OF_A_TRIAL = ("trial", "ending", "recording", "channel_names", "not_kept")


@pytest.mark.slow
def test_its_report_has_the_numbers_of_identify(tmp_path: Path, rig: Rig) -> None:
    (tmp_path / "rig.toml").write_text(rig_files.RIG, encoding="utf-8")
    kind = 'kind = "inverse_dynamics"\nlow_pass = "80 Hz"'
    test = rig_files.TEST.format(name="monday").replace('kind = "motion"', kind)
    mapping = rig_files.MAPPING + test
    rig_files.write(tmp_path / "monday.csv", rig, slice(0, 10_000))
    (tmp_path / "mapping.toml").write_text(mapping, encoding="utf-8")
    assert (
        import_recordings([str(tmp_path / "mapping.toml")], tmp_path / "results") is ExitCode.DONE
    )
    (path,) = (tmp_path / "results").glob("*.nxs")
    (reported,) = analyse_run(open_run(path), experiments())
    chosen, model = choose(path.parent, path.name), "inverse_dynamics"
    settings = [f"{model}.low_pass=80 Hz"]
    found = identify(chosen, experiments_by_model(), models=[model], settings=settings)
    (section,) = found.sections
    assert [each.known for each in reported.result.findings] == [
        each.estimate for each in section.identified.parameters
    ]
    assert {"inertia", "coulomb_positive"} <= {each.quantity for each in reported.result.findings}


@pytest.mark.parametrize("kind", ["inverse_dynamics", "whole_model"])
def test_nobody_plans_one(kind: str) -> None:
    own = experiments()[kind]
    with pytest.raises(ValueError, match="nothing to plan"):
        list(own.trials(own.options(), bench()))


def test_an_import_without_a_result_says_so(tmp_path: Path) -> None:
    """An axis that rests has no dynamics; exit code 6 follows from `lacks_result`."""
    (tmp_path / "rig.toml").write_text(rig_files.RIG, encoding="utf-8")
    test = rig_files.TEST.format(name="monday").replace('"motion"', '"inverse_dynamics"')
    (tmp_path / "mapping.toml").write_text(rig_files.MAPPING + test, encoding="utf-8")
    lines = (f"{0.001 * n:.3f},0.1,0.1,{0.01 * (n % 7)}" for n in range(4000))
    (tmp_path / "monday.csv").write_text("\n".join(["t,x,w,f", *lines]), encoding="utf-8")
    import_recordings([str(tmp_path / "mapping.toml")], tmp_path / "results")
    (path,) = (tmp_path / "results").glob("*.nxs")
    (reported,) = analyse_run(open_run(path), experiments())
    assert reported.lacks_result
    assert reported.account[0].startswith("no result: ")


def ramp() -> tuple[Done, ...]:
    options = {"positions": ["0 deg"], "directions": ["positive"]}
    return execute(planned("breakaway", bench(), options))


def test_a_report_has_the_warnings_of_a_model() -> None:
    left = Cause("half", "half of it is left out")()

    def identify(data: TestData, options: Options) -> Result:
        return Result(notes=("a note",), identified=IdentifiedRig((), left_out=(left,)))

    kind = of_any_motion("any", "", BreakawayOptions, lambda trials: (trials, ""), identify)
    assert kind.analyse(TestData("", "", {}, ramp())).notes == (left.text, "a note")


def test_metrics_of_another_kind_are_not_those_of_the_model() -> None:
    """Both experiments may call different numbers by one name."""
    (done,) = ramp()
    archived = [Estimate("torque", 1.0, "N m"), Estimate("torque", 2.0, "N m")]
    foreign = SimpleNamespace(**{name: getattr(done, name) for name in OF_A_TRIAL})
    foreign.estimates = archived[:1]

    def analyse(data: TestData) -> Result:
        found = metrics(data.trials[0], lambda item: archived[1:])["torque"]
        return Result(identified=IdentifiedRig((Parameter(found, ""),)))

    kind = Experiment("any", "", Options, nothing_to_plan, analyse)
    data: Any = TestData("", "", {}, (foreign,), model=Options())  # type: ignore[arg-type]
    assert result_of(kind, data).identified.parameters[0].estimate.value == 2.0
    own = replace(kind, name="breakaway")
    assert result_of(own, data).identified.parameters[0].estimate.value == 1.0


def test_a_model_that_two_packages_claim_is_nobodys(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {"own": "ramps", "one": "ramps", "other": "push", "third": "push"}
    own, one, other, third = (
        Experiment(
            name, "", Options, nothing_to_plan, lambda data: Result(), model=Model(model, "")
        )
        for name, model in names.items()
    )
    kinds = SimpleNamespace(
        described=lambda: [(each.name, each) for each in (one, own, other, third)],
        plug_in=lambda name: None if name == "own" else "a package",
    )
    monkeypatch.setattr("campaign.identify.experiments", lambda: kinds)
    assert experiments_by_model() == {"ramps": own}


def test_a_term_that_there_is_none_of_is_refused_where_it_stands(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(rig_files.RIG, encoding="utf-8")
    kind = 'kind = "inverse_dynamics"\nterms = ["inertai"]'
    test = rig_files.TEST.format(name="monday").replace('kind = "motion"', kind)
    (tmp_path / "mapping.toml").write_text(rig_files.MAPPING + test, encoding="utf-8")
    (tmp_path / "monday.csv").write_text("t,x,w,f\n0,0,0,0\n", encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"mapping\.toml:\d+:.*no term 'inertai'"):
        import_recordings([str(tmp_path / "mapping.toml")], tmp_path / "results")
