"""Installed packages with kinds, good and broken ones, from the command line."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from campaign.archive.reading.open_run import open_run
from tests.forks import MODULES
from tests.packages import FILM, Packages
from tests.system.user import SEA

BENCH = (Path(__file__).parents[2] / "protocols/benches/simulink.toml").read_text(encoding="utf-8")
LOAD = "[friction.load]"
GREASED = BENCH.replace(
    LOAD, f'[friction.mesh]\nmodel = "grease"\nyield_torque = "0.5 N m"\n\n{LOAD}'
)
GREASED_SEA = SEA.replace('"simulink"', '"greased.toml"\nseed = 5')

BROKEN = {
    "campaign.experiments/odd_experiment": "odd:EXPERIMENT",
    "campaign.friction/odd_friction": "odd:FRICTION",
    "campaign.compensation/odd_method": "odd:COMPENSATION",
    "campaign.backends/odd_backend": "odd:BACKEND",
    "campaign.exports/odd_format": "odd:EXPORT",
}

MOODY = '''
"""The simulated bench, which stops in its second trial while there is a file `halt`."""

from dataclasses import replace
from pathlib import Path

from campaign.backends import backends
from campaign.trial import Outcome

SIM = backends()["sim"]

class Moody(type(SIM.open(SIM.options()))):
    def execute(self, trial, recorder, stop):
        ended = super().execute(trial, recorder, stop)
        halted = trial.number == 2 and Path("halt").exists()
        return replace(ended, outcome=Outcome.INTERRUPTED, reason="halt") if halted else ended

BACKEND = replace(SIM, name="moody", open=Moody)
'''

BORROWED = """
from dataclasses import replace
from campaign.experiments.stabilization.experiment import EXPERIMENT as SEA
EXPERIMENT = replace(SEA, name="borrowed")
"""


class Laboratory(Packages):
    """Commands in a folder of its own."""

    def does(self, *arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        done = self.campaign(*arguments)
        assert "Traceback" not in done.stderr, done.stderr
        assert done.returncode == code, done.stdout + done.stderr
        return done

    def write(self, name: str, text: str) -> None:
        (self.folder.parent / name).write_text(text, encoding="utf-8")

    @property
    def archive(self) -> Path:
        return next((self.folder.parent / "results").glob("*.nxs"))


@pytest.fixture
def lab(tmp_path: Path) -> Laboratory:
    (tmp_path / "packages").mkdir()
    made = Laboratory(tmp_path / "packages")
    made.write("sea.toml", SEA)
    made.write("greased.toml", GREASED)
    made.write("greased_sea.toml", GREASED_SEA)
    return made


@pytest.fixture
def odd(lab: Laboratory) -> Laboratory:
    """With a package that leaves the program when it is imported, in every room."""
    lab.install("odd_pack", {"odd.py": "print('hello')\nraise SystemExit('no licence')\n"}, BROKEN)
    return lab


@pytest.mark.slow
def test_a_broken_package_harms_nothing_that_does_not_name_it(odd: Laboratory) -> None:
    """`plan`, `kinds` and `report` ended with exit code 70, "This is a bug"."""
    assert not odd.python(MODULES).stdout, "an import of the program imports no plug-in"
    odd.does("plan", "sea.toml")
    odd.does("check", "simulink")
    archive = odd.does("run", "sea.toml").stdout.splitlines()[-1]
    odd.does("show", archive)
    odd.does("report", archive)
    odd.does("export", archive, "--to", "csv")
    odd.does("kinds", "lugre")


def test_kinds_lists_what_works_and_says_what_does_not(odd: Laboratory) -> None:
    odd.grease()
    done = odd.does("kinds")
    row = "friction model\tgrease\ta film with a yield torque (of grease_film 1.0)"
    assert row in done.stdout.splitlines()
    assert "stribeck" in done.stdout
    told = " ".join(done.stderr.split())
    for point, value in BROKEN.items():
        name = point.partition("/")[2]
        assert name not in done.stdout
        assert f"'{name}' of the package odd_pack 1.0 (entry point {value}) cannot be used" in told
    assert told.count("SystemExit: no licence") == 5


ODD_KIND = SEA.replace('"stabilization"', '"odd_experiment"')
ODD_FRICTION = GREASED.replace('"grease"', '"odd_friction"')
ODD_METHOD = f'{BENCH}\n[compensation.odd_method]\ngain = "1 N m s/rad"\n'


def place(file: str, text: str, word: str) -> str:
    """Where `word` stands in a file, as errors say it."""
    before = text[: text.index(word)]
    return f"{file}:{before.count(chr(10)) + 1}:{len(before.rpartition(chr(10))[2]) + 1}"


@pytest.mark.parametrize(
    ("arguments", "where", "what"),
    [
        (("kinds", "odd_method"), "campaign", "compensation method"),
        (("plan", "sea.toml", "--backend", "odd_backend"), "campaign", "backend"),
        (("plan", "kind.toml"), place("kind.toml", ODD_KIND, '"odd_exp'), "experiment"),
        (("plan", "a.toml"), place("a_bench.toml", ODD_FRICTION, '"odd_fric'), "friction model"),
        (("check", "a_bench.toml"), place("a_bench.toml", ODD_FRICTION, '"odd'), "friction model"),
        (("plan", "b.toml"), place("b_bench.toml", ODD_METHOD, "odd_me"), "compensation method"),
    ],
)
def test_who_names_a_broken_kind_is_told_its_package_and_why(
    odd: Laboratory, arguments: tuple[str, ...], where: str, what: str
) -> None:
    odd.write("kind.toml", ODD_KIND)
    odd.write("a_bench.toml", ODD_FRICTION)
    odd.write("b_bench.toml", ODD_METHOD)
    odd.write("a.toml", SEA.replace('"simulink"', '"a_bench.toml"'))
    odd.write("b.toml", SEA.replace('"simulink"', '"b_bench.toml"'))
    said = odd.does(*arguments, code=2).stderr
    assert f"{where}: the {what} 'odd_" in said
    assert "of the package odd_pack 1.0 (entry point odd:" in said
    assert "SystemExit: no licence" in said


@pytest.mark.slow
def test_an_export_to_a_broken_format_is_refused(odd: Laboratory) -> None:
    odd.does("run", "sea.toml", "--only", "sea")
    done = odd.does("export", odd.archive.name, "--to", "odd_format", code=2)
    assert "of the package odd_pack 1.0 (entry point odd:EXPORT)" in done.stderr


@pytest.mark.slow
def test_a_report_says_which_test_it_cannot_analyse_and_analyses_the_others(
    lab: Laboratory,
) -> None:
    points = {"campaign.experiments/borrowed": "borrowed:EXPERIMENT"}
    lab.install("borrower", {"borrowed.py": BORROWED}, points)
    lab.grease()
    again = SEA.partition("\n\n")[2].replace('"sea"', '"again"')
    third = GREASED_SEA.partition("\n\n")[2].replace('"sea"', '"third"')
    again = again.replace('"stabilization"', '"borrowed"')
    lab.write("three.toml", f"{SEA}\n{again}\n{third}")
    lab.does("run", "three.toml")
    lab.install("borrower", {"borrowed.py": "1 / 0\n"}, points, "1.1")
    lab.grease("1.2", "import no_such_film")
    done = lab.does("report", lab.archive.name, code=6)
    told = " ".join(done.stderr.split())
    assert "the experiment 'borrowed' of the package borrower 1.1" in told
    assert "ZeroDivisionError" in told
    assert "the friction model 'grease' of the package grease_film 1.2" in told
    assert "No module named 'no_such_film'" in told
    page = Path(lab.folder.parent, done.stdout.splitlines()[-1]).read_text(encoding="utf-8")
    assert "borrower 1.1" in page
    assert page.count("<figure") > 0


def test_a_path_that_a_plug_in_does_not_declare_is_refused(lab: Laboratory) -> None:
    lab.grease()
    scatter = "\n[variation]\nday = 1\n\n[variation.day_to_day]\nmesh.film_thickness = 0.1\n"
    lab.write("greased.toml", GREASED + scatter)
    done = lab.does("plan", "greased_sea.toml", code=2)
    assert "friction.mesh has no parameter 'film_thickness'" in done.stderr
    assert "allowed are yield_torque" in done.stderr


def sha256(folder: Path, *names: str) -> str:
    """As `docs/developers/archive-format.md` says it."""
    whole = hashlib.sha256()
    for name in sorted(names):
        content = (folder / name).read_bytes()
        whole.update(name.encode() + b"\0" + str(len(content)).encode() + b"\0" + content)
    return whole.hexdigest()


@pytest.mark.slow
def test_the_archive_names_every_plug_in_and_resume_compares_it(lab: Laboratory) -> None:
    lab.grease()
    lab.install("moody", {"moody.py": MOODY}, {"campaign.backends/moody": "moody:BACKEND"}, "0.3")
    lab.install("idle", {"idle.py": BORROWED}, {"campaign.experiments/borrowed": "idle:EXPERIMENT"})
    lab.write("halt", "")
    lab.does("run", "greased_sea.toml", "--backend", "moody", "--workers", "1", code=130)
    files = [f"grease_film/{name}.py" for name in ("__init__", "film", "model")]
    grease = {
        "room": "friction model",
        "name": "grease",
        "distribution": "grease_film",
        "version": "1.0",
        "entry_point": "grease_film.model:FRICTION",
        "sha256": sha256(lab.folder, *files),
    }
    moody = {
        "room": "backend",
        "name": "moody",
        "distribution": "moody",
        "version": "0.3",
        "entry_point": "moody:BACKEND",
        "sha256": sha256(lab.folder, "moody.py"),
    }
    assert list(open_run(lab.archive).header.plugins) == [grease, moody]
    shown = lab.does("show").stdout
    short = grease["sha256"][:12]
    assert f"plug-ins:    friction model grease of grease_film 1.0, sources {short}" in shown
    assert json.loads(lab.does("show", "--json").stdout)["header"]["plugins"] == [grease, moody]

    (lab.folder.parent / "halt").unlink()
    lab.grease("1.1", FILM.replace("1.0", "2.0"))
    refused = lab.does("resume", lab.archive.name, code=2).stderr
    assert "plugins.friction-model.grease.version: 1.0 → 1.1" in refused
    assert f"plugins.friction-model.grease.sha256: {grease['sha256'][:40]}" in refused
    assert "moody" not in refused.replace(lab.archive.name, "")
    lab.grease("1.0", FILM + "# a comment is a difference, too\n")
    refused = lab.does("resume", lab.archive.name, code=2).stderr
    assert "grease.version" not in refused
    assert "plugins.friction-model.grease.sha256: " in refused
    lab.grease()
    lab.does("resume", lab.archive.name)
    assert open_run(lab.archive).status == "complete"


@pytest.mark.slow
def test_an_edited_helper_changes_the_numbers_of_the_next_run(lab: Laboratory) -> None:
    """They stayed those of before the edit, silently."""
    lab.grease()
    run = ("run", "greased_sea.toml", "--workers", "1")
    frictions = []
    for factor in ("1.0", "2.0"):
        lab.grease("1.0", FILM.replace("1.0", factor))
        archive = lab.does(*run, "--results", factor).stdout.splitlines()[-1]
        recording = open_run(lab.folder.parent / archive).trials[0].recording()
        frictions.append(abs(recording["friction_torque"]).max())
    assert frictions[0] + 0.3 < frictions[1]


@pytest.mark.slow
def test_a_package_whose_entry_points_are_no_table_ends_no_command(tmp_path: Path):
    """pydantic looks for plug-ins of its own in every package, and such a one ended it."""
    info = tmp_path / "bad-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: bad\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[campaign.friction]\nnothing\n")
    done = subprocess.run(
        [sys.executable, "-m", "campaign", "kinds"],
        env=os.environ
        | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "bad" in done.stderr
