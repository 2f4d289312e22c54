"""Putting records in order: whatever comes, nothing is taken twice and nothing silently missed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from campaign.link.errors import ViolationError
from campaign.link.records import LONGEST_PATIENCE, MOST, TRIES, MissingRecords, RecordOrder
from campaign.wire.messages import End, Fault, Outcome, Samples


def samples(number: int) -> Samples:
    return Samples(1, number, 10 * number, 10, bytes(80))


def test_what_comes_in_order_is_taken_and_nothing_is_asked_for() -> None:
    order = RecordOrder()
    for number in range(3):
        order.add(samples(number), 0.0)
    assert [record.number for record in order.take()] == [0, 1, 2]
    assert order.requests(1.0) == []
    assert order.take() == []


def test_a_gap_is_asked_for_at_once_and_then_with_growing_patience() -> None:
    order = RecordOrder()
    order.add(samples(0), 0.0)
    order.add(samples(3), 0.0)
    assert order.requests(0.0) == [(1, 2)]
    assert order.requests(0.05) == []
    assert order.requests(0.1) == [(1, 2)]
    assert order.requests(0.25) == []
    assert order.requests(0.31) == [(1, 2)]
    order.add(samples(2), 0.4)
    order.add(samples(1), 0.4)
    assert [record.number for record in order.take()] == [0, 1, 2, 3]
    assert order.requests(9.0) == []


def test_a_lost_tail_is_known_from_the_status() -> None:
    order = RecordOrder()
    order.add(samples(0), 0.0)
    order.exists(3, 0.0)
    assert order.requests(0.0) == [(1, 2)]


def test_nothing_is_asked_for_beyond_the_end() -> None:
    order = RecordOrder()
    order.add(End(1, 1, Outcome.COMPLETED, Fault.NONE, 10, True), 0.0)
    order.exists(9, 0.0)
    assert order.requests(0.0) == [(0, 1)]


def test_what_the_device_no_longer_has_is_missing() -> None:
    order = RecordOrder()
    order.add(samples(4), 0.0)
    order.lost(0, 3)
    assert order.take() == [MissingRecords(0, 3)]
    assert order.requests(0.0) == [(3, 1)]


def test_what_never_comes_is_given_up() -> None:
    order, now = RecordOrder(), 0.0
    order.add(samples(1), now)
    for _ in range(TRIES):
        assert order.requests(now) == [(0, 1)]
        now += LONGEST_PATIENCE
    assert order.take() == []
    assert order.requests(now) == []
    assert order.take() == [MissingRecords(0, 1), samples(1)]


def test_a_long_gap_is_asked_for_in_pieces() -> None:
    order = RecordOrder()
    order.add(samples(MOST + 1), 0.0)
    assert order.requests(0.0) == [(0, MOST), (MOST, 1)]


def test_an_absurd_number_is_a_violation_and_costs_no_memory() -> None:
    with pytest.raises(ViolationError, match="4294967294"):
        RecordOrder().exists(2**32 - 1, 0.0)


@given(st.lists(st.integers(0, 20), max_size=60), st.sets(st.integers(0, 20)))
def test_every_number_is_taken_once_or_missed_once(come: list[int], lost: set[int]) -> None:
    order, taken = RecordOrder(), []
    for number in come:
        order.add(samples(number), 0.0)
        taken += order.take()
    order.exists(21, 0.0)
    for number in lost:
        order.lost(number, 1)
    taken += order.take()
    for number in range(21):
        order.add(samples(number), 0.0)
    taken += order.take()
    numbers: list[int] = []
    for item in taken:
        if isinstance(item, MissingRecords):
            assert set(range(item.first, item.first + item.count)) <= lost - set(come)
            numbers += range(item.first, item.first + item.count)
        else:
            numbers.append(item.number)
    assert numbers == list(range(21))
