"""A fingerprint changes with what acts on motion, and with nothing else."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import fingerprint, why_altered

BENCHES = Path(__file__).parents[2] / "protocols" / "benches"


def tree(name: str, folder: Path = BENCHES) -> dict[str, Any]:
    return tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))


def changed(name: str, path: str, value: Any, folder: Path = BENCHES) -> Bench:
    """A shipped bench with one value written otherwise; None takes it away."""
    bench = copy.deepcopy(tree(name, folder))
    *above, last = path.split(".")
    table = bench
    for key in above:
        table = table.setdefault(key, {})
    if value is None:
        del table[last]
    else:
        table[last] = value
    return Bench.model_validate(bench)


@pytest.mark.parametrize("name", ["simulink", "platform"])
def test_the_shipped_benches_are_the_ones_they_describe(name: str) -> None:
    """Whoever changes one states anew what is known of it: `campaign fingerprint`."""
    bench = Bench.model_validate(tree(name))
    assert [why_altered(bench, method) for method in ("none", *bench.compensation)] == [""] * 4


@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("platform", "name", "renamed"),
        ("platform", "description", "another"),
        ("platform", "axis.name", "elevation"),
        ("platform", "limits.torque", "9 N m"),
        ("platform", "known.seen", ["5.13", "5.7", "5.3/gain_margin", "5.12"]),  # in another order
        ("platform", "known.correlations", []),
        ("platform", "axis.inertia", "69177.3 g m^2"),  # the same in another unit
        ("platform", "appendage.frequency", "0.011 kHz"),
        ("platform", "gear.preload.torque", "50 N m"),  # operating
        ("platform", "variation.day", 3),
        ("platform", "friction.motor.ripple", {"amplitude": 0.0, "periods": 9.0}),  # off
        ("platform", "compensation.mine", {"method": "observer", "gain": "1 N m s/rad"}),
        ("simulink", "controller.delay", "0 ms"),  # the default
        ("simulink", "friction.load.stribeck_exponent", 2.0),
        ("simulink", "variation", {"seed": 7, "day": 2}),  # scatters nothing
    ],
)
def test_what_acts_on_nothing_alters_nothing(name: str, path: str, value: Any) -> None:
    bench = changed(name, path, value)
    assert [why_altered(bench, method) for method in ("none", "static", "observer")] == [""] * 3


@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("platform", "axis.inertia", "68.7797 kg m^2"),
        ("platform", "gear.preload.shares", {"static_torque": 0.5}),
        ("platform", "gear.preload.nominal", "34 N m"),
        ("platform", "friction.load.ripple.phase", "31 deg"),
        ("platform", "variation.trial_to_trial", {}),
        ("platform", "sensors.gyro.noise", "0.003 deg/s"),
        ("simulink", "friction.load.side", "motor"),
        ("platform", "friction.mesh.preloaded", False),
        ("platform", "friction.load.negative.static_torque", "22.37 N m"),
        ("platform", "variation.seed", 45),
        ("platform", "controller.delay", None),
        ("platform", "appendage", None),
        ("simulink", "friction.load.bristle_stiffness", "9000 N m/rad"),
        ("simulink", "known.seen", []),
        ("simulink", "known.fitted", ["5.3"]),
        ("platform", "known.seen", None),
        ("platform", "known.given", ["4.1"]),
        ("platform", "known.fitted", ["5.3"]),
    ],
)
def test_what_acts_alters(name: str, path: str, value: Any) -> None:
    bench = changed(name, path, value)
    assert f"not the '{name}' that was described" in why_altered(bench)


def test_each_compensation_stands_for_itself() -> None:
    bench = changed("platform", "compensation.lugre.gain", 0.9)
    why = "the compensation 'lugre' is not the one of 'platform' as described"
    assert why_altered(bench, "lugre") == why
    assert why_altered(bench, "static") == why_altered(bench) == ""
    new = changed("platform", "compensation.mine", {"method": "observer", "gain": "1 N m s/rad"})
    assert "was not there when" in why_altered(new, "mine")


def test_what_is_known_of_no_bench_in_particular_is_altered() -> None:
    bench = changed("platform", "known.fingerprint", None)
    assert "states no fingerprint" in why_altered(bench)
    nothing = changed("simulink", "known", {})
    assert why_altered(nothing) == ""


def test_another_operating_path_is_another_description() -> None:
    """Else a path that was at its default when the bench was described could be freed later."""
    known = {**tree("platform")["known"], "operating": ["sensors.gyro.delay"]}
    assert why_altered(changed("platform", "known", known))


@pytest.mark.parametrize(
    ("name", "hashed"), [("platform", "75dd511abb81a6b5"), ("simulink", "25469eb9ef972b70")]
)
def test_a_bench_made_from_no_cells_has_the_hash_that_it_had_before_they_counted(
    name: str, hashed: str
) -> None:
    """Hashes of the shipped benches when no list of cells was part of them."""
    kept_benches = Path(__file__).parent / "kept"
    kept = ("document", "operating", "values", "correlations")
    entries = {
        key: value for key, value in tree(name, kept_benches)["known"].items() if key in kept
    }
    assert fingerprint(changed(name, "known", entries, kept_benches)).bench == hashed


def test_an_optional_field_of_a_later_program_alters_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Newer(Bench):
        cogging: float | None = None
        backlash: float = 0.0
        brake: BrakeOptions | None = None

    class BrakeOptions(Options):
        torque: float = 1.0

    Newer.model_rebuild(_types_namespace={"BrakeOptions": BrakeOptions})
    was = fingerprint(Bench.model_validate(tree("platform")))
    newer = tree("platform")
    assert fingerprint(Newer.model_validate(newer)) == was
    assert fingerprint(Newer.model_validate({**newer, "backlash": 0.0, "brake": {}})) == was
    assert fingerprint(Newer.model_validate({**newer, "backlash": 0.1})) != was


def test_an_archived_bench_has_the_fingerprint_of_the_written_one() -> None:
    bench = Bench.model_validate(tree("platform"))
    archived = Bench.model_validate(bench.model_dump(mode="json"), context={"si": True})
    assert archived == bench
    assert fingerprint(archived) == fingerprint(bench)


def known(**entries: Any) -> Bench:
    return changed("simulink", "known", entries)


def test_uncertainty_is_one_sigma_in_si() -> None:
    """An interval of 95 % is 2 · 1.96 standard deviations wide."""
    bench = known(
        values={
            "motor.torque_constant": {"interval": ["82 mN m/A", "0.090 N m/A"]},
            "axis.inertia": {"standard_uncertainty": "5 %", "origin": "measured"},
            "gear.ratio": {"standard_uncertainty": 0.02},
            "motor.resistance": {"origin": "assumed"},
        },
        correlations=[["axis.inertia", "gear.ratio", -0.5]],
    )
    assert bench.known_uncertainty("motor.torque_constant") == pytest.approx(0.008 / 3.919928)
    assert bench.known_uncertainty("axis.inertia") == pytest.approx(1.75)
    assert bench.known_uncertainty("gear.ratio") == 0.02
    assert bench.known_uncertainty("motor.resistance") is None
    assert bench.known_uncertainty("motor.inductance") is None
    archived = Bench.model_validate(bench.model_dump(mode="json"), context={"si": True})
    assert archived.known_uncertainty("axis.inertia") == pytest.approx(1.75)


@pytest.mark.parametrize(
    ("entries", "place", "message"),
    [
        ({"values": {"axis.name": {}}}, ("values", "axis.name"), "no number at 'axis.name'"),
        ({"operating": ["variation.day"]}, ("operating", 0), "no number at 'variation.day'"),
        (
            {"values": {"axis.inertia": {"standard_uncertainty": 2.0}}},
            ("values", "axis.inertia", "standard_uncertainty"),
            "2 has no unit; write it as text",
        ),
        (
            {"values": {"gear.ratio": {"interval": [150, 130.0]}}},
            ("values", "gear.ratio", "interval"),
            "the lower end comes first",
        ),
        ({"correlations": [["a", "b", 2.0]]}, ("correlations", 0, 0), "'a' is none of known"),
    ],
)
def test_what_leads_nowhere_is_said_where_it_stands(
    entries: dict[str, Any], place: tuple[str | int, ...], message: str
) -> None:
    with pytest.raises(ValidationError) as caught:
        known(**entries)
    first = caught.value.errors()[0]
    assert first["loc"][-len(place) :] == place
    assert message in first["msg"]


def test_the_first_archives_of_format_3_have_cells_beside_what_is_known() -> None:
    plain = {key: value for key, value in tree("simulink").items() if key != "known"}
    written = Bench.model_validate(plain).model_dump(mode="json")
    del written["known"]
    beside = {**written, "given": ["4.1"], "fitted": ["5.3"]}
    archived = Bench.model_validate(beside, context={"si": True})
    assert (archived.known.given, archived.known.fitted) == (("4.1",), ("5.3",))
    nothing = {**written, "given": [], "fitted": []}
    assert not Bench.model_validate(nothing, context={"si": True}).known.describes
    with pytest.raises(ValidationError, match=r"fitted\n +Extra inputs"):
        Bench.model_validate({**plain, "fitted": ["5.3"]})
