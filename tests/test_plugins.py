"""Kinds of installed packages: by name, one at a time, and each broken one by itself."""

from __future__ import annotations

import importlib
import importlib.util
import json
import math
import pkgutil
import re
import shutil
import tomllib
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import Field, TypeAdapter, ValidationError

from campaign import entry_points
from campaign.backends import backends
from campaign.entry_points import InstalledPlugins, PlugIn
from campaign.errors import ExitCode
from campaign.experiments import experiments
from campaign.export import exports
from campaign.physics.compensation import compensation_methods
from campaign.physics.friction import FrictionField, friction_models
from campaign.plugins import Kinds
from tests.packages import FILM, GREASE, ROOT, Packages
from tests.physics.benches import bench

ROOMS = {
    "campaign.experiments": (experiments, "EXPERIMENT"),
    "campaign.backends": (backends, "BACKEND"),
    "campaign.export": (exports, "EXPORT"),
    "campaign.physics.friction": (friction_models, "FRICTION"),
    "campaign.physics.compensation": (compensation_methods, "COMPENSATION"),
}

OWN = (
    "armstrong", "bliman-sorine", "coulomb", "dahl", "elasto-plastic", "gms", "karnopp", "leuven",
    "lugre", "lugre-fading", "stribeck",
)  # fmt: skip
"""Friction models of this program."""


@pytest.fixture
def packages(tmp_path: Path) -> Packages:
    (tmp_path / "packages").mkdir()
    return Packages(tmp_path / "packages")


def said(packages: Packages, code: str) -> Any:
    """What `code` prints as JSON."""
    done = packages.python(code)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("package", ROOMS)
def test_the_names_read_from_sources_are_those_that_the_modules_have(package: str) -> None:
    registry, attribute = ROOMS[package]
    names = []
    for each in pkgutil.iter_modules(importlib.import_module(package).__path__):
        inner = f"{package}.{each.name}.{attribute.lower()}"
        has_file = each.ispkg and importlib.util.find_spec(inner) is not None
        module = importlib.import_module(inner if has_file else f"{package}.{each.name}")
        if hasattr(module, attribute):
            names.append(getattr(module, attribute).name)
    kinds: Kinds[Any] = registry()
    assert list(kinds) == sorted(names)
    assert [kind.name for kind in kinds.values()] == list(kinds)
    assert not list(kinds.plug_ins)


@pytest.mark.slow
def test_names_import_no_kind_and_a_kind_imports_no_other(packages: Packages) -> None:
    packages.grease()
    code = """
import json, sys
from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
def kinds():
    return [m for m in ("campaign.physics.friction.lugre", "campaign.physics.friction.stribeck",
                        "grease_film") if m in sys.modules]
names = list(friction_models())
there = "grease" in friction_models()
before = kinds()
model = friction_models()["grease"]
print(json.dumps([names, there, before, model.summary, kinds()]))
"""
    names, there, before, summary, after = said(packages, code)
    assert names == sorted([*OWN, "grease"])
    assert there
    assert before == []
    assert summary == "a film with a yield torque"
    assert after == ["grease_film"]


@pytest.mark.parametrize(
    "first",
    [
        "import grease_film.model",
        "import campaign.physics.friction.interface",
        "import campaign.physics.friction",
        "import campaign.physics.compilation",
        "import campaign.physics.bench",
        "import campaign.physics.compensation.friction_model",
        "import campaign.experiments",
    ],
)
def test_a_plug_in_can_be_imported_by_its_own_tests(packages: Packages, first: str) -> None:
    packages.grease()
    code = f"""
{first}
import json
from grease_film.model import FRICTION
from campaign.physics.friction import friction_models
print(json.dumps(friction_models()["grease"] is FRICTION))
"""
    assert said(packages, code) is True


BROKEN = {
    "raise ImportError('no such drive')": "ImportError: no such drive",
    "import nowhere_to_be_found": "No module named 'nowhere_to_be_found'",
    "def (": "SyntaxError",
    "import sys; sys.exit(3)": "SystemExit: 3",
    "class Odd(BaseException): pass\nraise Odd('unheard of')": "Odd: unheard of",
    "1 / 0": "ZeroDivisionError: division by zero",
    "": "has no attribute 'FRICTION'",
    "FRICTION = 7": "it is 'int', no FrictionModel of this program",
    GREASE.replace('name="grease"', 'name="oil"'): (
        "it calls itself 'oil'; both names must be the same"
    ),
    GREASE.replace("=GreaseOptions", "=dict"): "its options are no subclass",
    GREASE.replace('Literal["grease"]', "str"): (
        "its options lack the field `model: Literal['grease']`"
    ),
}


def test_each_broken_one_is_named_with_its_package_and_harms_no_other(packages: Packages) -> None:
    """Side by side in one process: kinds `grease0`, `grease1` ..., each of its own package."""

    def own(text: str, n: int) -> str:
        text = text.replace("grease_film.film", f"film{n}")
        return re.sub("""(["'])grease(["'])""", rf"\1grease{n}\2", text)

    for n, source in enumerate(BROKEN):
        files = {f"sticky{n}.py": own(source, n), f"film{n}.py": FILM}
        entry = {f"campaign.friction/grease{n}": f"sticky{n}:FRICTION"}
        packages.install(f"sticky_pack{n}", files, entry, "2.1")
    code = f"""
import json
from campaign.errors import UsageError
from campaign.physics.friction import friction_models
models = friction_models()
messages = []
for attempt in range(2):
    for n in range({len(BROKEN)}):
        try:
            models[f"grease{{n}}"]
        except UsageError as error:
            messages.append(str(error))
print(json.dumps([list(models), models["lugre"].name, messages]))
"""
    names, works, messages = said(packages, code)
    numbers = range(len(BROKEN))
    assert names == sorted([*OWN, *(f"grease{n}" for n in numbers)])
    assert works == "lugre"
    assert len(messages) == 2 * len(BROKEN)
    for n, (source, again) in enumerate(zip(BROKEN, messages[len(BROKEN) :], strict=True)):
        message = messages[n]
        assert message.startswith(
            f"the friction model 'grease{n}' of the package sticky_pack{n} 2.1 (entry point "
            f"sticky{n}:FRICTION) cannot be used: "
        )
        assert own(BROKEN[source], n) in message
        assert "\n" not in message
        assert again == message


def test_a_name_of_the_program_stays_the_program_s(packages: Packages) -> None:
    packages.install("rival", {"rival.py": "1 / 0"}, {"campaign.friction/lugre": "rival:FRICTION"})
    code = """
import json
from campaign.physics.friction import friction_models
described = [(n, k if isinstance(k, str) else k.name) for n, k in friction_models().described()]
print(json.dumps([friction_models()["lugre"].step.__module__, described]))
"""
    module, described = said(packages, code)
    assert module == "campaign.physics.friction.lugre"
    (rival,) = (text for name, text in described if name != text)
    assert "rival 1.0" in rival
    assert "the program has one of that name" in rival
    at = described.index(["lugre", rival])
    assert described[:at] + described[at + 1 :] == [[name, name] for name in OWN]
    assert described[at - 1] == ["lugre", "lugre"]


def test_a_name_that_two_packages_claim_is_nobody_s(packages: Packages) -> None:
    packages.grease()
    packages.install("other", {"other.py": ""}, {"campaign.friction/grease": "other:FRICTION"})
    code = """
import json
from campaign.errors import UsageError
from campaign.physics.friction import friction_models
try:
    friction_models()["grease"]
except UsageError as error:
    print(json.dumps([str(error), list(friction_models())]))
"""
    message, names = said(packages, code)
    assert "grease_film 1.0" in message
    assert "other 1.0" in message
    assert "remove all but one" in message
    assert names == sorted([*OWN, "grease"])


def test_a_package_that_cannot_be_read_costs_only_its_own(packages: Packages) -> None:
    packages.grease()
    packages.declare("mangled", "[campaign.friction]\nmud = mud:FRICTION\n")
    (packages.folder / "mangled-1.0.dist-info" / "METADATA").unlink()
    packages.install("lost", {}, {"campaign.frictions/slime": "lost:FRICTION"})
    packages.install("late", {}, {"campaign.identification_methods/mud": "late:METHOD"})
    code = """
import json
from campaign.physics.friction import friction_models
from campaign.plugins import stray_entries
print(json.dumps([list(friction_models()), sorted(stray_entries())]))
"""
    names, strays = said(packages, code)
    assert names == sorted([*OWN, "grease"])
    assert len(strays) == 3
    assert any("late 1.0" in stray and "experiment with a `model`" in stray for stray in strays)
    assert any("lost 1.0" in stray and "no group 'campaign.frictions'" in stray for stray in strays)
    assert any("with mud:FRICTION" in stray and "cannot be read" in stray for stray in strays)


def test_the_first_of_a_name_on_the_path_is_the_one_that_counts(
    packages: Packages, tmp_path: Path
) -> None:
    packages.grease("2.0")
    behind = Packages(tmp_path / "behind")
    behind.grease("1.0")
    behind.declare("grease_film", "[campaign.friction]\nslime = grease_film.model:FRICTION\n")
    code = f"""
import json, sys
sys.path.append({str(behind.folder)!r})
from campaign.physics.friction import friction_models
print(json.dumps([list(friction_models()), friction_models().plug_in("grease").version]))
"""
    assert said(packages, code) == [sorted([*OWN, "grease"]), "2.0"]


PAGE = (ROOT / "docs" / "developers" / "plug-ins.md").read_text(encoding="utf-8")


@pytest.fixture
def page(packages: Packages) -> Packages:
    """The package of docs/developers/plug-ins.md."""
    found = re.findall(r"^```\w+ ([\w./]+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    files = dict(found)
    assert set(files) == {"pyproject.toml", "grease.py", "tests/test_grease.py", "sheet.py"}
    project = tomllib.loads(files["pyproject.toml"])["project"]
    points = {
        f"{group}/{name}": value
        for group, entries in project["entry-points"].items()
        for name, value in entries.items()
    }
    packages.install(project["name"], files, points, project["version"])
    return packages


@pytest.mark.slow
def test_the_page_s_own_test_passes(page: Packages) -> None:
    shutil.rmtree(page.folder / "grease-1.0.dist-info")
    code = """
import sys, pytest
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "packages/tests/test_grease.py"]))
"""
    done = page.python(code)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout


@pytest.mark.slow
def test_the_page_s_model_can_be_named_by_a_bench_and_compiles(page: Packages) -> None:
    code = """
import json
import numpy as np
from campaign.physics.friction import FrictionField, friction_models
from campaign.physics.step_function import Motion, single_step
from pydantic import TypeAdapter
tree = {"model": "grease", "yield_torque": "8 N m", "shear_rate": "0.1 rad/s"}
options = TypeAdapter(FrictionField).validate_python(tree)
model = friction_models()["grease"]
line = single_step(
    model.step, model.parameters(options), np.zeros(0), Motion.at(0.1, 0.1, step=1e-3)
)
print(json.dumps([options.model_dump(mode="json")["model"], line[0], line[1]]))
"""
    name, torque, change = said(page, code)
    assert name == "grease"
    # (e - 1/e) / (e + 1/e), with e = exp(1)
    assert torque == pytest.approx(8 * (math.e**2 - 1) / (math.e**2 + 1))
    assert change == 0.0


def test_a_choice_reports_as_a_union_of_tables_does() -> None:
    """pydantic's own discriminated union, built of the same classes, is what it is held against."""
    kinds = reduce(or_, (friction_models()[name].options for name in OWN))
    union = Annotated[kinds, Field(discriminator="model")]
    ours, theirs = TypeAdapter(FrictionField), TypeAdapter(union)
    good = bench().friction["load"]
    for value in [
        {"model": "lugri"},
        {"model": 3},
        {"model": "lugre"},
        {"model": "stribeck", "coulomb_torque": "2 A", "odd": 1},
        {"coulomb_torque": 1},
        {},
        7,
        None,
        [good],
    ]:
        assert errors(ours, value) == errors(theirs, value)
    assert ours.validate_python(good) is theirs.validate_python(good) is good
    tree = good.model_dump(mode="json")
    assert ours.validate_python(tree, context={"si": True}) == good
    assert ours.dump_python(good, mode="json") == tree
    assert ours.dump_json(good) == theirs.dump_json(good)


def errors(adapter: TypeAdapter[Any], value: Any) -> list[tuple[Any, ...]]:
    with pytest.raises(ValidationError) as caught:
        adapter.validate_python(value)
    return [(e["type"], e["loc"], e["msg"]) for e in caught.value.errors()]


PLUG_IN = PlugIn("campaign.backends", "greasy", "Greasy", "1.2", "greasy:BACKEND", ("greasy",))


def raised(code: str, module: str) -> BaseException:
    """The error that the function `fail` of a module raises."""
    names: dict[str, Any] = {"__name__": module, "json": json}
    exec(code, names)
    try:
        names["fail"]()
    except (Exception, SystemExit) as error:  # noqa: BLE001 (the error is the result)
        return error
    raise AssertionError("no error")


@pytest.mark.parametrize(
    ("code", "module", "blames"),
    [
        ("def fail(): raise ValueError", "greasy.rig", True),
        ("def fail(): raise SystemExit(0)", "greasy", True),
        ("def fail(): json.loads('')", "greasy", True),  # in a library that it calls
        ("def fail(): json.loads('')", "campaign.cli.main", False),
        ("def fail(): raise SystemExit(0)", "typer.core", False),
        ("def fail(): raise ValueError", "greasy_too", False),
    ],
)
def test_a_plug_in_is_blamed_for_errors_in_and_below_it(
    code: str, module: str, blames: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(entry_points, "installed", lambda: InstalledPlugins((PLUG_IN,), ()))
    assert entry_points.blamed(raised(code, module)) == (PLUG_IN if blames else None)


def test_an_error_of_a_plug_in_names_its_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(entry_points, "installed", lambda: InstalledPlugins((PLUG_IN,), ()))

    def app(**_: object) -> None:
        raise raised("def fail(): raise ValueError('no grease')", "greasy")

    main = importlib.import_module("campaign.cli.main")
    monkeypatch.setattr(main, "app", app)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == ExitCode.LIMIT_OR_FAULT
    said = capsys.readouterr().err
    assert "the package Greasy 1.2 failed: ValueError: no grease" in said
