"""Trials of later stages: in the journal, separate from the plan.

The plan of a run never changes. The journal gets the trials of a stage before the first of them is
executed, in the form of `plan-trials.jsonl`, with their trees (benches and options). Readers append
them to the plan.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from pydantic import JsonValue

from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.header import PlannedTrial
from campaign.archive.layout.journal import FollowedTrial, TrialRefused, TrialsFollowed
from campaign.archive.layout.record import restored_trial, shared_trees
from campaign.trial import Tree, Trial, canonical_json


def trials_followed(
    at: str,
    test: str,
    stage: int,
    name: str,
    point: Mapping[str, JsonValue],
    trials: Sequence[Trial],
    refused: Iterable[tuple[str, str]] = (),
    reason: str = "",
) -> TrialsFollowed:
    """The line of the journal for a stage; see `journal.TrialsFollowed`."""
    trees: dict[str, Tree] = {}
    described = []
    for trial in trials:
        tree, own = shared_trees(trial)
        trees |= own
        planned = PlannedTrial.of(trial).model_dump(mode="json")
        described.append(FollowedTrial.model_validate({**planned, "trial": tree}))
    return TrialsFollowed(
        at=at,
        test=test,
        stage=stage,
        name=name,
        point=dict(point),
        reason=reason,
        trials=tuple(described),
        trees=trees,
        refused=tuple(TrialRefused(label=label, why=why) for label, why in refused),
    )


def trials_in(stages: Iterable[TrialsFollowed]) -> Iterator[Trial]:
    """The trials of stages, ready for execution. Raises ValueError if one is damaged."""
    for stage in stages:
        for digest, tree in stage.trees.items():
            if text_digest(canonical_json(tree)) != digest:
                raise ValueError(f"a tree of the stage '{stage.name}' does not match its digest")
        for each in stage.trials:
            try:
                trial = restored_trial(each.trial, stage.trees)
            except LookupError:
                raise ValueError(f"{each.label}: something of it is missing") from None
            if trial.number != each.number:
                raise ValueError(f"{each.label}: is trial {each.number} and {trial.number}")
            yield trial
