"""Trials that followed from others: in the journal, counted to the plan, and held against it."""

import json

import pytest

from campaign.archive.layout.followup_trials import stages_in, trials_followed, trials_in
from campaign.archive.layout.journal import TrialsFollowed
from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import list_runs
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError
from campaign.recording import Outcome

AT = "2026-11-21T09:37:02Z"
STAGED = [{"name": "map", "kind": "velocity_map", "stages": [{"number": 2}]}]


def follow(trials, stage=2, **more) -> TrialsFollowed:
    return trials_followed(AT, "map", stage, "refinement", {"compensation": "none"}, trials, **more)


def begun(tmp_path, kit):
    """Two planned trials that have finished, and a stage of two, of which one has."""
    writer, _ = kit.begin(tmp_path, 2, [50, 60], tests=STAGED)
    other = kit.trial(4).model_copy(update={"bench": {"name": "its own", "x": 5e-324}})
    further = [kit.trial(3), other]
    writer.note(follow(further, refused=[("map [speed=9]", "too fast")]))
    kit.record(writer, kit.trial(3), 70)
    return writer, further


def looks(writer, kit):
    yield open_run(writer.folder)
    yield open_run(writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED))


def test_they_are_trials_of_the_run_for_every_reader(tmp_path, kit):
    writer, further = begun(tmp_path, kit)
    for run in looks(writer, kit):
        assert [trial.number for trial in run.plan] == [1, 2, 3, 4]
        assert [trial.number for trial in run.first_stage] == [1, 2]
        assert [trial.fingerprint for trial in run.plan[2:]] == [t.fingerprint for t in further]
        assert run.header.trials == 2
        assert [run.planned(3), run.planned(4)] == further
        assert len(run.full_plan) == 4
        assert [trial.trial.number for trial in run.trials_of("map")] == [1, 2, 3]
        (stage,) = run.stages
        assert (stage.stage, stage.name, stage.refused[0].why) == (2, "refinement", "too fast")
        verified = verify_run(run.path)
        assert (verified.problems, verified.trials) == ((), 3)
        (listed,) = list_runs(tmp_path)
        assert (listed.trials, listed.planned) == (3, 4)
        with pytest.raises(ArchiveError, match="no trial 5"):
            run.planned(5)


def test_a_sealed_run_is_gone_on_with_and_has_them_again(tmp_path, kit):
    writer, further = begun(tmp_path, kit)
    path = writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)
    writer = RunWriter.resume(path, **kit.RESUMED)
    assert list(trials_in(stages_in(read_journal(writer.folder / JOURNAL).entries))) == further
    assert writer.archived(3).trial == further[0]
    assert writer.archived(3).ending.outcome is Outcome.COMPLETED
    with pytest.raises(LookupError):
        writer.archived(4)
    kit.record(writer, further[1], 80)
    path = writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    assert verify_run(path).problems == ()
    assert [trial.trial for trial in open_run(path).trials[2:]] == further


def test_the_last_attempt_is_what_a_stage_is_shown(tmp_path, kit):
    writer, _ = begun(tmp_path, kit)
    kit.record(writer, kit.trial(1), 11)
    assert len(writer.archived(1).recording().time) == 11


def edited(writer, change):
    """The journal with the line of the stage changed."""
    path = writer.folder / JOURNAL
    lines = path.read_text().splitlines()
    (place,) = (n for n, line in enumerate(lines) if "trials followed" in line)
    entry = json.loads(lines[place])
    change(entry)
    lines[place] = json.dumps(entry)
    path.write_text("".join(line + "\n" for line in lines))


def exchange_bench(entry):
    digest = next(d for d, tree in entry["trees"].items() if tree.get("name") == "its own")
    entry["trees"][digest]["name"] = "another"


def exchange_task(entry):
    entry["trials"][0]["trial"]["task"]["duration"] = 3.0


def forget_bench(entry):
    entry["trees"] = {}


def exchange_number(entry):
    entry["trials"][1]["trial"]["number"] = 9


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (exchange_bench, "does not match its digest"),
        (forget_bench, "something of it is missing"),
        (exchange_number, "is trial 4 and 9"),
        (exchange_task, "trial 3 does not match its fingerprint"),
    ],
)
def test_a_changed_line_is_found(tmp_path, kit, change, told):
    writer, _ = begun(tmp_path, kit)
    edited(writer, change)
    assert any(told in str(damage) for damage in verify_run(writer.folder).problems)
    run = open_run(writer.folder)
    assert run.damaged == ()
    if change is not exchange_task:
        with pytest.raises(ArchiveError, match=r"journal\.jsonl"):
            run.planned(4)


def renumber(entry):
    for trial in entry["trials"]:
        trial["number"] += 10


def test_numbers_go_on_after_the_plans(tmp_path, kit):
    writer, _ = begun(tmp_path, kit)
    edited(writer, renumber)
    problems = [str(damage) for damage in verify_run(writer.folder).problems]
    assert any("otherwise than after the plan's" in text for text in problems)
    assert any("trial_00003: is not in the plan" in text for text in problems)


def test_a_stage_is_told_once(tmp_path, kit):
    writer, _ = begun(tmp_path, kit)
    writer.note(follow([kit.trial(5)]))
    (problem,) = verify_run(writer.folder).problems
    assert "names the trials of a stage 2 times" in str(problem)


def test_a_line_that_is_none_is_damage_and_its_trials_can_still_be_read(tmp_path, kit):
    writer, _ = begun(tmp_path, kit)
    edited(writer, lambda entry: entry["trials"][0].pop("label"))
    run = open_run(writer.folder)
    assert [damage.reason for damage in run.damaged] == ["is not a line of a journal"]
    assert [trial.trial.number for trial in run.trials] == [1, 2, 3]


def test_runs_without_stages_say_nothing_of_them(tmp_path, kit):
    path = kit.run(tmp_path)
    run = open_run(path)
    assert (run.stages, run.first_stage) == ((), run.plan)
    assert "followed" not in run.journal
