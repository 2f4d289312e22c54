"""What differs between the circumstances of two runs."""

from __future__ import annotations

from campaign.comparison.circumstances import _benches
from campaign.protocol.bench_file import load_bench


def test_benches_differ_in_what_moves_them_and_in_no_words() -> None:
    bench = load_bench("simulink")
    renamed = bench.model_copy(update={"description": "the same one, told anew"})
    assert list(_benches("bench", bench, renamed)) == []
    gyro = bench.sensors.gyro.model_copy(update={"noise": 2 * bench.sensors.gyro.noise + 1e-6})
    other = bench.model_copy(update={"sensors": bench.sensors.model_copy(update={"gyro": gyro})})
    [change] = _benches("bench", bench, other)
    assert change.path == "sensors.gyro.noise"
