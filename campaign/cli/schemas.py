"""`campaign schema` and `campaign init`, which writes schema files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from campaign.cli.output import print_json, print_line
from campaign.errors import UsageError, writing
from campaign.experiments import experiments
from campaign.importing.json_schema import mapping_schema
from campaign.interrupts import unwinding
from campaign.protocol.json_schema import bench_schema, protocol_schema
from campaign.report.formats.as_json import report_schema
from campaign.resources import copy_shipped

SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "protocol": lambda: protocol_schema(experiments()),
    "bench": bench_schema,
    "mapping": lambda: mapping_schema(experiments()),
    "report": report_schema,
}
FOLDER = "schemas"
RULES = """\
# JSON Schema of each file, for editors (taplo, Even Better TOML).
# `campaign schema protocol` and `campaign schema bench` print them.
[[rule]]
include = ["**/*.toml"]
exclude = ["**/benches/**", "**/calibration/**", "**/.taplo.toml"]
schema = { path = "./schemas/protocol.json" }

[[rule]]
include = ["**/benches/*.toml"]
exclude = ["**/calibration/**"]
schema = { path = "./schemas/bench.json" }
"""


@unwinding()
def init_folder(folder: Path) -> None:
    """Copy the shipped files into `folder`, and print the next steps."""
    written = copy_shipped(folder)
    print_line(f"{len(written)} files written to {folder}")
    _write_schemas(folder)
    print_line(f"now: campaign run {folder / 'protocols' / 'quickstart.toml'} --report")


def print_schema(of: str) -> None:
    """Print the JSON Schema of a name in SCHEMAS. Raises UsageError for another name."""
    if of not in SCHEMAS:
        raise UsageError(f"there is no schema of {of!r}; there are {', '.join(SCHEMAS)}")
    print_json(SCHEMAS[of]())


def _write_schemas(folder: Path) -> None:
    """Write the schemas of protocols and benches, and their rules; existing files stay."""
    files = {
        f"{FOLDER}/{of}.json": json.dumps(SCHEMAS[of](), indent=1, ensure_ascii=False) + "\n"
        for of in ("protocol", "bench")
    }
    with writing(folder):
        (folder / FOLDER).mkdir(exist_ok=True)
        for name, text in {**files, ".taplo.toml": RULES}.items():
            if not (folder / name).exists():
                (folder / name).write_text(text, encoding="utf-8", newline="\n")
