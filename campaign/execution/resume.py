"""Whether and how a run continues: finished trials and changes since."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from campaign.archive.layout.header import PlannedTrial, RunHeader
from campaign.archive.layout.journal import Decision, TrialFinished
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.resume_run import RESUMABLE
from campaign.errors import ArchiveError, UsageError
from campaign.execution.provenance import shaping
from campaign.protocol import PlannedStage
from campaign.protocol.plan_tree import planned_stage
from campaign.recording import Outcome
from campaign.text import shortened
from campaign.trial import Tree, Trial, canonical_json

SHOWN = 20
"""Maximum number of listed differences."""

_SETTLED = (Outcome.COMPLETED, Outcome.LIMIT, Outcome.DIVERGED)
_WIDTH = 60
_ABSENT = object()


def check_resumable(run: RunReader) -> None:
    """Raise UsageError if the run cannot be resumed, ArchiveError if its plan is damaged.

    An unsealed folder with a seed can be resumed, also one with a recorded end: the program was
    killed before it sealed the run.
    """
    if run.sealed and run.status not in RESUMABLE:
        raise UsageError(
            f"{run.name}: is {run.status.value}: every planned trial was executed, and there is "
            "nothing to go on with; `campaign run` makes a new run"
        )
    if run.header.seed is None:
        raise UsageError(
            f"{run.name}: does not say its seed, without which its plan cannot be made again; "
            "start a new run"
        )
    if len(run.first_stage) != run.header.trials:
        raise ArchiveError(
            f"{run.name}: its plan has {len(run.first_stage)} of {run.header.trials} trials: it is "
            "damaged; start a new run"
        )


def not_repeated(run: RunReader) -> dict[int, Outcome]:
    """Outcomes of the trials that are not executed again, by number.

    A trial with a fault is among them only if the policy skipped it. Without that decision it ended
    the run, or its retry is missing.
    """
    skipped = _skipped(run)
    return {
        each.trial.number: each.ending.outcome
        for each in run.trials
        if each.ending.outcome in _SETTLED
        or (each.ending.outcome is Outcome.FAULT and each.trial.number in skipped)
    }


def _skipped(run: RunReader) -> set[int]:
    """Numbers of the trials that the policy skipped after their last attempt."""
    skipped: set[int] = set()
    for entry in run.story.entries:
        if isinstance(entry, TrialFinished):
            skipped.discard(entry.trial)
        elif isinstance(entry, Decision) and entry.trial is not None and entry.decision == "skip":
            skipped.add(entry.trial)
    return skipped


def differences(was: RunHeader, now: RunHeader) -> list[str]:
    """All conditions of the samples that differ, as `dotted.path: was → is`.

    The paths are those of `--set`. A difference that several tests share, e.g. of a bench, is
    listed once.
    """
    options = _compare(was.backend_options, now.backend_options, "backend")
    versions = _compare(shaping(was.versions), shaping(now.versions), "versions")
    plug_ins = _compare(_by_room(was.plugins), _by_room(now.plugins), "plugins")
    return [
        *(_line(*each) for each in options),
        *_of_tests(_by_name(was.normalised), _by_name(now.normalised)),
        *(_line(*each) for each in (*versions, *plug_ins)),
    ]


def trial_differences(planned: Sequence[PlannedTrial], trials: Sequence[Trial]) -> list[str]:
    """Trials with a changed fingerprint, as `name.fingerprint: was → is`."""
    return [
        f"{trial.name}.fingerprint: {was.fingerprint[:12]} → {trial.fingerprint[:12]}"
        for was, trial in zip(planned, trials, strict=True)
        if was.fingerprint != trial.fingerprint
    ]


def followed(
    run: RunReader, trials: Sequence[Trial], finished: Mapping[int, Outcome]
) -> tuple[Trial, ...]:
    """The trials of stages, from the journal.

    `trials`: the present planned trials. Raises UsageError if an unfinished trial of a stage
    depends on changed trials: results of one bench must not determine motions of another.
    """
    changed = {
        trial.test
        for was, trial in zip(run.first_stage, trials, strict=True)
        if was.fingerprint != trial.fingerprint
    }
    followups = tuple(
        run.full_plan.trial(each.number) for stage in run.stages for each in stage.trials
    )
    for trial in followups:
        if trial.number not in finished and trial.test in changed:
            raise UsageError(
                f"{run.name}: {trial.name} ({trial.label}) follows from what was found before "
                f"{trial.test} was changed; undo the change, or start a new run"
            )
    return followups


def stages_of(header: RunHeader) -> tuple[PlannedStage, ...]:
    """Planned stages from the header, for a run without its protocol file."""
    return tuple(
        planned_stage(str(test["name"]), stage)  # type: ignore[arg-type]
        for test in header.tests
        for stage in test.get("stages", ())  # type: ignore[union-attr]
    )


def same_list(planned: Sequence[PlannedTrial], trials: Sequence[Trial]) -> bool:
    """Whether both plans list the same trials in the same order, regardless of their content."""

    def key(trial: PlannedTrial | Trial) -> tuple[object, ...]:
        return (trial.number, trial.test, trial.kind, trial.role, trial.label)

    return list(map(key, planned)) == list(map(key, trials))


def listed(lines: Sequence[str]) -> str:
    """The first `SHOWN` lines, and the number of others."""
    return "\n".join(f"  {line}" for line in shortened(lines, SHOWN))


def _by_name(normalised: Tree) -> dict[str, Any]:
    """Tests by name, with options at the paths of `--set` and matrix axes by path."""
    tests: Any = json.loads(canonical_json(normalised.get("tests", [])))
    trees = {}
    for test in tests:
        rest = {key: value for key, value in test.items() if key not in ("name", "options")}
        rest["matrix"] = dict(test.get("matrix", []))
        trees[test["name"]] = {**test.get("options", {}), **rest}
    return trees


def _by_room(plug_ins: Sequence[Tree]) -> dict[str, Any]:
    """Plug-in records by `room.name`."""
    return {
        f"{str(each.get('room')).replace(' ', '-')}.{each.get('name')}": {
            key: value for key, value in each.items() if key not in ("room", "name")
        }
        for each in plug_ins
    }


def _of_tests(was: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    tests_by_change: dict[tuple[str, str, str], list[str]] = {}
    for name in dict.fromkeys((*was, *now)):
        for path, before, after in _compare(was.get(name, _ABSENT), now.get(name, _ABSENT)):
            tests_by_change.setdefault((path, _short(before), _short(after)), []).append(name)
    lines = []
    for (path, before, after), names in tests_by_change.items():
        place = ".".join(filter(None, (names[0], path)))
        others = f" (and in {len(names) - 1} other tests)" if len(names) > 1 else ""
        lines.append(f"{place}{others}: {before} → {after}")
    return lines


def _compare(was: Any, now: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    if isinstance(was, dict) and isinstance(now, dict):
        for key in dict.fromkeys((*was, *now)):
            below = f"{path}.{key}" if path else str(key)
            yield from _compare(was.get(key, _ABSENT), now.get(key, _ABSENT), below)
    elif isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        for index, (one, other) in enumerate(zip(was, now, strict=True)):
            yield from _compare(one, other, f"{path}[{index}]")
    elif _differ(was, now):
        yield path, was, now


def _differ(was: Any, now: Any) -> bool:
    if was is _ABSENT or now is _ABSENT:
        return was is not now
    return canonical_json(was) != canonical_json(now)


def _line(path: str, was: Any, now: Any) -> str:
    return f"{path}: {_short(was)} → {_short(now)}"


def _short(value: Any) -> str:
    if value is _ABSENT:
        return "absent"
    if isinstance(value, dict):
        return "present"
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _WIDTH else text[: _WIDTH - 3] + "..."
