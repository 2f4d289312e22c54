"""`python -m benchmarks.dependencies [--write]`: size and import time of what pip installs.

Size is of the installed package alone; packages that only others need are in the last row. Time is
that of a new process that imports it, less that of one that imports nothing; median of 5.
"""

from __future__ import annotations

import re
import statistics
import subprocess
import sys
import time
from importlib.metadata import PackageNotFoundError, distribution, requires

from packaging.requirements import Requirement

from benchmarks.document import DOCS, machine, table, write_section

PAGE = DOCS / "developers" / "packaging.md"
MODULES = {"tree-sitter": "tree_sitter", "tree-sitter-toml": "tree_sitter_toml"}
MODULES |= {"pyserial": "serial", "isal": "isal.igzip_lib"}
MODULES |= {"python-can": "can"}
WHAT_FOR = {
    "h5py": "archives",
    "isal": "packs samples faster than zlib",
    "jinja2": "the report's page",
    "matplotlib": "figures",
    "numba": "the engine",
    "numpy": "everything",
    "packaging": "`doctor` compares versions; matplotlib needs it, too",
    "pandas": "tables of `campaign.open`, CSV export",
    "platformdirs": "where the user's cache is",
    "pydantic": "validation of protocols, benches and archives",
    "rich": "progress and tables in a terminal",
    "scipy": "fits, loops, intervals",
    "tomlkit": "`identify --output` keeps a bench's comments",
    "tree-sitter": "line and column of a mistake in TOML",
    "tree-sitter-toml": "its grammar of TOML",
    "typer": "the command line",
    "pyserial": "controllers",
    "canopen": "servo drives on CAN",
    "python-can": "adapters of CAN",
    "xarray": "`trial.dataset()`",
    "h5netcdf": "archives opened by xarray alone",
    "pyarrow": "Parquet, written and imported",
    "distributed": "clusters",
    "nptdms": "import of TDMS",
    "openpyxl": "import of Excel",
    "asammdf": "import of MDF",
    "plotext": "`run --watch`",
}


def main() -> None:
    """Print the table, and write it into its page where that is asked for."""
    own = [Requirement(text) for text in requires("campaign") or ()]
    rows, listed = [], {"campaign"}
    for each in own:
        extra = "".join(re.findall(r"extra == ['\"](\w+)['\"]", str(each.marker or "")))
        if each.name in WHAT_FOR and extra not in ("all", "test", "mutants"):
            listed.add(each.name.lower())
            shown = f"{megabytes(each.name):.1f}", f"{milliseconds(each.name):.0f}"
            rows.append([each.name, extra, *shown, WHAT_FOR[each.name]])
    others = sorted(needed([each.name for each in own if not each.marker]) - listed)
    total = sum(map(megabytes, others))
    rows.append([", ".join(others), "", f"{total:.1f}", "", "needed by those without an extra"])
    core = sum(float(row[2]) for row in rows if not row[1])
    text = f"{machine()}. Without extras {core:.0f} MB installed.\n\n"
    text += table(["package", "extra", "MB", "import, ms", "what for"], rows)
    print(text)
    if "--write" in sys.argv:
        write_section("dependencies", text, PAGE)


def needed(names: list[str]) -> set[str]:
    """All that packages need, directly or not, in lower case."""
    found: set[str] = set()
    while names:
        name = names.pop().lower()
        if name not in found:
            found.add(name)
            asked = (Requirement(text) for text in requires(name) or ())
            names += [e.name for e in asked if not e.marker or e.marker.evaluate({"extra": ""})]
    return found


def megabytes(name: str) -> float:
    """What the files of an installed package take."""
    try:
        files = distribution(name).files or ()
    except PackageNotFoundError:
        return float("nan")
    there = (path for each in files if (path := each.locate()).is_file() and path.suffix != ".pyc")
    return sum(path.stat().st_size for path in there) / 1e6


def milliseconds(name: str) -> float:
    """What importing a package takes."""
    module = MODULES.get(name, name)

    def timed(code: str) -> float:
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        return time.perf_counter() - began

    timed(f"import {module}")
    return 1e3 * statistics.median(timed(f"import {module}") - timed("pass") for _ in range(5))


if __name__ == "__main__":
    main()
