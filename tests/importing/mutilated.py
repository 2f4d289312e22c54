"""Listed columns in files as programs, spreadsheets and people leave them."""

from __future__ import annotations

import random
from pathlib import Path

from campaign.importing.cells import name_and_unit
from tests.importing.listed import Listed, Source

INDEX = Listed("", ("index", "unknown"), "-")


def mutilate(source: Source, path: Path, seed: int) -> tuple[Listed, ...]:
    """Write a file of these columns in some other way; the columns that it has then."""
    chance = random.Random(seed)
    source.write(path, seed)
    lines = path.read_text(encoding="utf-8").splitlines()
    heads = 2 if any(each.second for each in source.columns) else 1
    head = [line.split(source.separator) for line in lines[:heads]]
    body = [line.split(source.separator) for line in lines[heads:]]
    blank = source.separator == " "
    columns = source.columns

    def does(share: float) -> bool:
        return chance.random() < share

    apart = [name_and_unit(cell) for cell in head[0]]
    if heads == 1 and not blank and any(unit for _, unit in apart) and does(0.4):
        head = [[name for name, _ in apart], [unit for _, unit in apart]]
    if not blank and does(0.3):
        head = [["", *cells] for cells in head]
        body = [[str(k), *cells] for k, cells in enumerate(body)]
        columns = (INDEX, *columns)
    if not blank and does(0.2):
        head = [[f'"{cell}"' for cell in cells] for cells in head]
    if does(0.3):
        for row in chance.sample(body, 5):
            row[chance.randrange(1, len(row))] = "nan" if blank else ""
    end = source.separator if not blank and does(0.25) else ""
    mark = "# " if does(0.2) else ""
    above = ["Test rig 7", "Operator: lab", "Sample rate: 250 Hz", ""] if does(0.3) else []
    rows = [mark + source.separator.join(cells) + end for cells in head]
    rows += [source.separator.join(cells) + end for cells in body]
    newline, codec = chance.choice(["\n", "\r\n"]), chance.choice(["utf-8", "utf-8-sig", "utf-16"])
    path.write_bytes((newline.join([*above, *rows]) + newline).encode(codec))
    return columns
