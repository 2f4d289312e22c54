"""Reads mutated archives, in a process of its own so that a crash of HDF5 would be seen.

    python mutations.py FOLDER COUNT SEED

FOLDER holds `run.nxs` and `killed.partial`, both whole. Prints how many mutations were refused, how
many had damage listed, and how many were read whole. Fails on any error but ArchiveError, and on
content that is not what was written.
"""

import random
import resource
import sys
from collections import Counter
from pathlib import Path

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import list_runs
from campaign.archive.reading.sound_samples import whole_recording
from campaign.archive.verification.verify_run import verify_run
from campaign.errors import ArchiveError

MEMORY = 4 << 30  # bytes of address space: a size that is believed would end the process


def mutate(content: bytes, rng: random.Random) -> bytes:
    """Bytes flipped, a truncation, a run of zeros, or two blocks that changed places."""
    changed = bytearray(content)
    kind = rng.choice(("flip", "flips", "cut", "zeros", "swap", "rubbish"))
    size = min(len(changed), rng.choice((8, 64, 512, 4096)))
    one, other = (rng.randrange(len(changed) - size + 1) for _ in range(2))
    if kind in ("flip", "flips"):
        for _ in range(1 if kind == "flip" else 30):
            changed[rng.randrange(len(changed))] ^= rng.randrange(1, 256)
    elif kind == "cut":
        del changed[one:]
    elif kind == "zeros":
        changed[one : one + size] = bytes(size)
    elif kind == "swap":
        first, second = changed[one : one + size], changed[other : other + size]
        changed[one : one + size], changed[other : other + size] = second, first
    else:
        changed[one : one + size] = rng.randbytes(size)
    return bytes(changed)


def read(path: Path) -> tuple[dict, int]:
    """Every recording that can be read, by trial, and how much cannot."""
    run = open_run(path)
    recordings, damaged = {}, len(run.damaged)
    for archived in run.trials:
        try:
            recording = whole_recording(archived)
        except ArchiveError:
            damaged += 1
            continue
        channels = {name: c.samples.tobytes() for name, c in recording.channels.items()}
        recordings[archived.trial.number] = (archived.trial, recording.time.tobytes(), channels)
    return recordings, damaged


def try_one(victim: Path, run: Path, expected: dict, rng: random.Random) -> str:
    content = victim.read_bytes()
    changed = mutate(content, rng)
    victim.write_bytes(changed)
    try:
        if changed != content and run.is_file():
            assert not verify_run(run).sound, "verify found nothing"
        else:
            verify_run(run)
        list_runs(run.parent)
        found, damaged = read(run)
        for number, recording in found.items():
            assert recording == expected[number], f"trial {number} is not what was written"
        return "listed" if damaged else "read"
    except ArchiveError:
        return "refused"
    finally:
        victim.write_bytes(content)


def main(folder: Path, count: int, seed: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    rng = random.Random(seed)
    sealed, killed = folder / "run.nxs", folder / "killed.partial"
    whole = {run: read(run)[0] for run in (sealed, killed)}
    texts = ("journal.jsonl", "run.json", "plan.jsonl", "trial-00001.trial")
    tally: Counter[str] = Counter()
    for number in range(count):
        run = killed if number % 4 == 0 else sealed
        victim = killed / rng.choice(texts) if run is killed else sealed
        tally[try_one(victim, run, whole[run], rng)] += 1
    sys.stdout.write(" ".join(f"{kind}={tally[kind]}" for kind in ("refused", "listed", "read")))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
