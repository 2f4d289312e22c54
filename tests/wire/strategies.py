"""Any message of the protocol, for Hypothesis."""

from __future__ import annotations

from hypothesis import strategies as st

from campaign.wire import messages as wire

U8, U16, U32 = st.integers(0, 2**8 - 1), st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
POSITIVE = st.integers(1, 2**32 - 1)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
TEXT = st.text(st.characters(codec="utf-8"), max_size=20)
STATES, FAULTS = st.sampled_from(wire.State), st.sampled_from(wire.Fault)
WORD = st.from_regex(r"[A-Za-z0-9_-]{1,8}", fullmatch=True)
NAME = st.lists(WORD, min_size=1, max_size=4).map(".".join)


@st.composite
def slices(draw: st.DrawFn) -> wire.ArraySlice:
    values = tuple(draw(st.lists(FINITE, max_size=10)))
    if not values:
        return wire.ArraySlice(0, 0, ())
    offset = draw(st.integers(0, 1000))
    return wire.ArraySlice(offset + len(values) + draw(st.integers(0, 9)), offset, values)


INT64 = st.integers(-(2**63), 2**63 - 1)
ITEM = st.builds(wire.Item, NAME, st.one_of(FINITE, INT64, st.booleans(), TEXT, slices()))
ITEMS = st.lists(ITEM, max_size=4).map(tuple)
WORDS = st.lists(TEXT, max_size=4).map(tuple)
CHANNEL = st.builds(
    wire.Channel, TEXT, TEXT, TEXT, TEXT, st.booleans(), st.sampled_from(wire.Format), FINITE
)


@st.composite
def samples(draw: st.DrawFn) -> wire.Samples:
    count, size = draw(st.integers(1, 10)), draw(st.integers(1, 90))
    data = draw(st.binary(min_size=count * size, max_size=count * size))
    return wire.Samples(draw(U32), draw(U32), draw(U32), count, data)


@st.composite
def channels(draw: st.DrawFn) -> wire.Channels:
    listed = tuple(draw(st.lists(CHANNEL, min_size=1, max_size=2)))
    first = draw(st.integers(0, 100))
    rate = draw(st.floats(1e-3, 1e6))
    return wire.Channels(draw(U16), first + len(listed) + draw(U8) % 50, first, rate, listed)


def _range(kind: type[wire.Resend] | type[wire.LostRecords]) -> st.SearchStrategy[wire.Message]:
    pairs = st.tuples(U32, POSITIVE).map(lambda p: (p[0], min(p[1], 2**32 - p[0])))
    return st.tuples(U32, pairs).map(lambda p: kind(p[0], *p[1]))


HOST = st.one_of(
    st.builds(wire.Hello, U8, U8, POSITIVE, TEXT),
    st.builds(wire.Set, st.lists(ITEM, min_size=1, max_size=4).map(tuple)),
    st.builds(wire.Arm, U32),
    st.builds(wire.Start, POSITIVE),
    st.builds(wire.Heartbeat, U32, U32, U32, U32),
    _range(wire.Resend),
    st.builds(wire.Release, U32),
    st.builds(wire.Safe, U32, TEXT),
    st.builds(wire.Unlatch, U32, TEXT),
    st.builds(wire.Bye, POSITIVE),
    st.sampled_from([wire.Stop(), wire.Safe(), wire.Clear(), wire.Query()]),
)
DEVICE = st.one_of(
    st.builds(
        wire.Capabilities, U16, U8, U8, U8, U32, STATES, FINITE, U32, U32, FINITE, TEXT, TEXT,
        WORDS, WORDS, ITEMS,
    ),
    st.builds(wire.Ack, U16, st.sampled_from(wire.Kind), STATES, U32),
    st.builds(wire.Nak, U16, U8, st.sampled_from(wire.NakCode), STATES, TEXT, TEXT),
    channels(),
    st.builds(
        wire.Status, STATES, FAULTS, st.booleans(), st.booleans(), U32, FINITE, U32, FINITE, U32,
        U32, U32, U32, U32, st.none() | FINITE,
    ),
    samples(),
    st.builds(wire.Event, U32, U32, FINITE, TEXT),
    st.builds(
        wire.End, U32, U32, st.sampled_from(wire.Outcome), FAULTS, U32, st.booleans(), TEXT
    ),
    _range(wire.LostRecords),
    st.builds(
        wire.Latch, st.booleans(), U32, st.sampled_from(wire.LatchCause), st.none() | FINITE, TEXT
    ),
    st.builds(wire.Holder, st.booleans(), st.none() | FINITE, TEXT),
)  # fmt: skip
MESSAGE = HOST | DEVICE
