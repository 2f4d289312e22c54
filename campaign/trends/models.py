"""Parameters of one model structure fitted to all runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from campaign.errors import UsageError
from campaign.experiments.interface import Experiment, bench_of
from campaign.identify.identification import Section, fitted_again, identify
from campaign.identify.material import ChosenRun
from campaign.parameter import Parameter
from campaign.trends.members import Member
from campaign.trends.series import Collected, Seen, Series, why_twin


@dataclass(frozen=True)
class TrendFit:
    """Parameters of one method over the runs.

    Attributes:
        problems: unusable runs with reasons.
    """

    method: str
    series: tuple[Series, ...]
    problems: tuple[str, ...]


def fit_models(
    members: Sequence[Member], known: Mapping[str, Experiment], models: Sequence[str]
) -> tuple[TrendFit, ...]:
    """Fit each method to all runs. Raises UsageError for unknown methods."""
    unknown = [name for name in models if name not in known]
    if unknown:
        raise UsageError(f"--model {unknown[0]!r}: there are {', '.join(known)}")
    return tuple(_fitted(members, known, name) for name in dict.fromkeys(models))


def _fitted(members: Sequence[Member], known: Mapping[str, Experiment], name: str) -> TrendFit:
    first: Section | None = None
    fits: dict[str, tuple[Parameter, Collected]] = {}
    problems: list[str] = []
    seen: Seen = {}
    for member in members:
        why, section = _section(member, known, name, first)
        if section is None or section.result is None:
            problems.append(f"{member.name}: {name}: {why}")
            continue
        if first is None:
            first = section
            fits = {
                each.estimate.name: (each, Collected(each.estimate.unit))
                for each in section.identified.parameters
            }
        prints = tuple(text for own in member.identical.values() for text in own)
        same = why_twin(seen, member, prints)
        for parameter in section.identified.parameters:
            if parameter.estimate.name in fits:
                fits[parameter.estimate.name][1].add(member, "", parameter.estimate, same)
    series = tuple(
        collected.series(
            test=name,
            title=known[name].model.summary,
            quantity=each,
            name=each.replace("_", " "),
            display=parameter.display or parameter.estimate.unit,
        )
        for each, (parameter, collected) in fits.items()
    )
    return TrendFit(name, series, tuple(problems))


def _section(
    member: Member, known: Mapping[str, Experiment], name: str, first: Section | None
) -> tuple[str, Section | None]:
    """Reason for no result, and section of a run, with the structure of `first` if given."""
    trials = tuple(each for each in member.run.trials if each.is_completed_measurement)
    if not trials:
        return "no trial was completed", None
    chosen = ChosenRun(member.run, "", trials)
    try:
        if first is not None:
            section = fitted_again(first, bench_of(trials[0].trial), chosen)
        else:
            (section,) = identify(chosen, known, models=[name]).sections
    except UsageError as error:
        return str(error), None
    return section.problem, section
