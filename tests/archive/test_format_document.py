"""The format's description says what is in the file, and its example reads one."""

import re
from pathlib import Path

import h5py
import pytest

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.storage import CHUNK

DOCUMENT = Path(__file__).parents[2] / "docs" / "developers" / "archive-format.md"


@pytest.fixture(scope="module")
def text():
    return DOCUMENT.read_text(encoding="utf-8")


def test_the_example_reads_an_archive(text, sealed, monkeypatch, capsys):
    example = re.search(r"```python\n(.*?)```", text, re.S)[1]
    monkeypatch.chdir(sealed.parent)
    example = re.sub(r'"results/[^"]+"', repr(sealed.name), example)
    exec(compile(example, str(DOCUMENT), "exec"), {})
    told = capsys.readouterr().out.splitlines()
    assert told[1] == "trial_00002 map {'compensation': 'none', 'speed': 0.2} completed"


def test_everything_in_a_file_is_described(text, tmp_path, kit):
    path = kit.run(tmp_path, [2 * CHUNK])
    words = set(re.findall(r"[a-z0-9_]+", text))
    channels = {channel.name for channel in kit.CHANNELS}
    missing = set()

    def check(name, item):
        own = re.sub(r"_\d+$", "", name.split("/")[-1])
        missing.update({own, *item.attrs} - words - channels)

    with h5py.File(path) as file:
        file.visititems(check)
    # NX_class is NeXus' own; the rest is how HDF5 writes a dimension scale.
    known = {"NX_class", "CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "trial", "source"}
    assert missing - known == set()
    assert set(RunHeader.model_fields) <= words
