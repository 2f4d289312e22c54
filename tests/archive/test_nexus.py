"""The archive is valid NeXus by the judgement of the NeXus community's own checker."""

import re
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from campaign.archive import RunStatus, RunWriter
from campaign.archive.hdf5 import CHUNK
from campaign.archive.nexus import REQUIRED
from campaign.trial import ChannelInfo, Ending, Outcome


def nxcheck(path: Path) -> tuple[int, int, str]:
    """Errors, warnings and the output of `nxcheck`, which exits with 0 whatever it finds."""
    command = "import sys; from nexusformat.scripts.nxcheck import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", command, str(path)], capture_output=True, text=True, check=True
    )
    output = done.stdout + done.stderr
    errors = re.search(r"Total number of errors: (\d+)", output)
    warnings = re.search(r"Total number of warnings: (\d+)", output)
    assert errors, output
    assert warnings, output
    return int(errors[1]), int(warnings[1]), output


@pytest.mark.parametrize("counts", [[50], [20, None, 0], [2 * CHUNK], []])
def test_a_sealed_run_has_no_errors_and_no_warnings(tmp_path, kit, counts):
    errors, warnings, output = nxcheck(kit.run(tmp_path, counts))
    assert (errors, warnings) == (0, 0), output


def test_a_trial_file_of_a_run_in_progress_is_valid_by_itself(tmp_path, kit):
    writer = RunWriter.create(tmp_path, kit.header(), [kit.trial(1)])
    kit.record(writer, kit.trial(1), 50)
    errors, warnings, output = nxcheck(writer.folder / "trial-00001.nxs")
    assert (errors, warnings) == (0, 0), output


def test_the_checker_finds_what_is_wrong(sealed):
    """The test above would pass on anything if this did not fail."""
    import h5py

    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data"].attrs["NX_class"] = "NXnonsense"
    errors, _, _ = nxcheck(sealed)
    assert errors > 0


def test_a_run_may_have_many_benches(tmp_path, kit):
    trials = [
        kit.trial(number).model_copy(update={"bench": {"name": f"bench {number}"}})
        for number in (1, 2, 3)
    ]
    writer = RunWriter.create(tmp_path, kit.header(), trials)
    for trial in trials:
        recorder = writer.begin(trial)
        recorder.start(tuple(ChannelInfo(name, "rad", name, "rad") for name in REQUIRED))
        recorder.finish(Ending(Outcome.COMPLETED), kit.STARTED, kit.ENDED)
    with h5py.File(writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)) as file:
        names = [file[f"trial_0000{n}/instrument/name"][()].decode() for n in (1, 2, 3)]
    assert names == ["bench 1", "bench 2", "bench 3"]
