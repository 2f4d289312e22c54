"""What a test ran on, held against what its bench says of itself, trial by trial."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest

from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import fingerprint
from campaign.physics.bench_knowledge import KnownOptions
from campaign.published.provenance import OF_A_TRUTH, provenance_of
from campaign.trial import Role, Task, Tree, Trial

BENCHES = Path(__file__).parents[2] / "protocols" / "benches"


def described(name: str = "platform") -> Tree:
    text = (BENCHES / f"{name}.toml").read_text(encoding="utf-8")
    return Bench.model_validate(tomllib.loads(text)).model_dump(mode="json")


def with_value(path: str, value: Any, bench: Tree | None = None) -> Tree:
    tree: Any = copy.deepcopy(bench or described())
    *above, last = path.removeprefix("bench.").split(".")
    table = tree
    for key in above:
        table = table[key]
    table[last] = value
    return tree


def trial(
    bench: Tree,
    compensation: str = "none",
    role: Role = Role.MEASUREMENT,
    truth: str = "",
    **point: Any,
) -> Trial:
    task = Task(
        mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=10.0, compensation=compensation
    )
    return Trial(
        number=1,
        test="t",
        kind="k",
        seed=1,
        bench=bench,
        task=task,
        role=role,
        point=point,
        truth=truth,
    )


PRELOAD, HEAVY = "bench.gear.preload.torque", with_value("axis.inertia", 60.0)


@pytest.mark.parametrize(
    ("trials", "altered"),
    [
        ([trial(described()), trial(described(), "lugre")], False),
        ([trial(HEAVY)], True),
        # A matrix over an operating path, and a warm-up, which is behind nothing.
        ([trial(with_value(PRELOAD, v), **{PRELOAD: v}) for v in (33.0, 50.0)], False),
        ([trial(HEAVY, role=Role.WARM_UP), trial(described())], False),
    ],
)
def test_what_was_measured_on_another_bench_is_altered(trials: list[Trial], altered: bool) -> None:
    why = provenance_of(trials).why_altered({})
    assert bool(why) is altered
    assert ("not the 'platform' that was described" in why) is altered


def test_only_the_points_that_the_conditions_name() -> None:
    path = "bench.axis.inertia"
    known = described()["axis"]["inertia"]
    trials = [trial(with_value(path, v), **{path: v}) for v in (known, 60.0)]
    found = provenance_of(trials)
    assert found.why_altered({path: known}) == ""
    assert found.why_altered({path: 60.0})
    assert found.why_altered({}), "it may be of both"
    assert found.why_altered({path: 5.0}), "where no point fits, all are behind it"


def test_a_compensation_counts_where_it_runs() -> None:
    bench = with_value("compensation.lugre.gain", 0.5)
    found = provenance_of([trial(bench, name) for name in ("none", "static", "lugre")])
    assert found.why_altered({"compensation": "static"}) == ""
    assert "compensation 'lugre'" in found.why_altered({"compensation": "lugre"})


@pytest.mark.parametrize("bench", [described(), with_value("known", {})])
@pytest.mark.parametrize("perturbs", [False, True])
@pytest.mark.parametrize("kept", [False, True])
def test_a_truth_is_another_bench_whatever_is_stated(
    bench: Tree, perturbs: bool, kept: bool
) -> None:
    trials = [trial(bench, case="stated"), trial(bench, truth="0" * 64, case="true")]
    found = provenance_of(trials, perturbs_bench=perturbs, described=described() if kept else None)
    assert found.why_altered({"case": "true"}) == OF_A_TRUTH
    assert found.why_altered({"case": "stated"}) == ""


def test_a_declared_study_of_perturbations_counts_by_its_reference() -> None:
    perturbed = [
        trial(with_value("friction.load.static_torque", v), change=v) for v in (10.0, 30.0)
    ]
    assert provenance_of(perturbed).why_altered({}), "an experiment that does not declare it"
    declared = provenance_of(perturbed, perturbs_bench=True, described=described())
    assert declared.why_altered({}) == ""
    altered = with_value("axis.inertia", 60.0)
    found = provenance_of(perturbed, perturbs_bench=True, described=altered)
    assert found.why_altered({})


def test_a_matrix_beneath_a_study_of_perturbations_still_alters() -> None:
    path = "bench.axis.inertia"
    trials = [trial(with_value(path, 60.0), **{path: 60.0})]
    assert provenance_of(trials, perturbs_bench=True, described=described()).why_altered({})


def test_without_the_reference_one_unperturbed_trial_stands_for_it() -> None:
    """Of an archive that did not keep the protocol's benches."""
    perturbed = trial(with_value("friction.load.static_torque", 30.0))
    both = provenance_of([trial(described()), perturbed], perturbs_bench=True)
    assert both.why_altered({}) == ""
    assert provenance_of([perturbed], perturbs_bench=True).why_altered({})


def test_a_swept_table_goes_by_a_name_that_may_be_any_of_them() -> None:
    path = "bench.friction.load"
    table = described()["friction"]["load"]
    found = provenance_of([trial(described(), **{path: table})])
    assert found.why_altered({path: "lugre"}) == ""


@pytest.mark.parametrize(
    ("bench", "told"),
    [
        ({"name": "x"}, "cannot be read"),
        (with_value("known", {"fitted": ["5.3"]}), "states no fingerprint"),
        (with_value("known", {}), ""),
    ],
)
def test_benches_of_all_ages(bench: Tree, told: str) -> None:
    why = provenance_of([trial(bench)]).why_altered({})
    assert told in why
    assert bool(why) is bool(told)


def test_an_archive_of_an_older_program_has_the_former_places() -> None:
    """It was calibrated, and nobody can tell whether it still is that bench."""
    old = {key: value for key, value in described().items() if key != "known"}
    plain = trial({**old, "given": [], "fitted": []})
    assert provenance_of([plain]).why_altered({}) == ""
    fitted = trial({**old, "given": ["4.3"], "fitted": ["5.3"]})
    assert "states no fingerprint" in provenance_of([fitted]).why_altered({})


SEED = "bench.variation.seed"


def draws(*seeds: int, **more: Any) -> list[Trial]:
    return [trial(with_value(SEED, seed, **more), **{SEED: seed}) for seed in seeds]


@pytest.mark.parametrize("perturbs", [False, True])
def test_several_draws_of_its_scatter_are_the_bench(perturbs: bool) -> None:
    found = provenance_of(draws(44, 1, 2), perturbs_bench=perturbs, described=described())
    assert found.why_altered({}) == ""
    assert found.seeds == {44, 1, 2}


@pytest.mark.parametrize(
    ("seeds", "own"),
    [
        ((7,), 44),  # chosen by what it gives
        ((7, 12), 44),  # two of them, as near to each other as wanted
        ((44, 7), 7),  # --set says 7, and the sweep says it again
    ],
)
def test_a_chosen_draw_is_another_bench(seeds: tuple[int, ...], own: int) -> None:
    found = provenance_of(draws(*seeds), described=with_value(SEED, own))
    assert "not the 'platform' that was described" in found.why_altered({})


def test_beneath_the_draws_the_bench_is_looked_at() -> None:
    wide = with_value("variation.day_to_day.static_torque", 0.2)
    found = provenance_of(draws(44, 1, bench=wide), described=described())
    assert found.why_altered({})
    still = {**described(), "variation": None}
    scattering = [
        trial(
            {**still, "variation": {"seed": s, "day_to_day": {"static_torque": 0.2}}}, **{SEED: s}
        )
        for s in (0, 1)
    ]
    assert provenance_of(scattering, described=still).why_altered({})
    assert provenance_of(draws(44, 1)).why_altered({}), "nobody kept which bench it began with"


def test_a_bench_that_says_nothing_is_undescribed() -> None:
    """Whoever empties [known] and changes the bench gains nothing over who only changes it."""
    bench = with_value("axis.inertia", 60.0, with_value("known", {}))
    found = provenance_of([trial(bench)])
    assert (found.why_altered({}), found.is_described({})) == ("", False)
    assert provenance_of([trial(described())]).is_described({})


def test_one_undescribed_trial_is_enough() -> None:
    """An archive may be written by hand, trial by trial."""
    trials = [trial(described(), case="a"), trial(with_value("known", {}), case="b")]
    found = provenance_of(trials)
    assert not found.is_described({})
    assert found.is_described({"case": "a"})
    assert not found.is_described({"case": "b"})


def test_which_trials_failed_is_told_by_place() -> None:
    first = trial(described(), speed=1.0).model_copy(update={"number": 1, "options": {"a": 2.0}})
    second = trial(described(), speed=2.0).model_copy(update={"number": 2})
    found = provenance_of([first, second], failed={2})
    assert [(place.failed, dict(place.numbers)) for place in found.places] == [
        (False, {"a": 2.0}),
        (True, {}),
    ]


def test_trials_of_two_descriptions_are_of_no_bench() -> None:
    """Each is the bench that it states, and of the second nothing is said to be fitted."""
    other = Bench.model_validate(with_value("known", {}), context={"si": True})
    other = other.model_copy(update={"known": KnownOptions(fingerprint=fingerprint(other))})
    second = trial(other.model_dump(mode="json"), case="b")
    assert provenance_of([second]).why_altered({}) == ""
    found = provenance_of([trial(described(), case="a"), second])
    assert "different descriptions" in found.why_altered({"case": "b"})
