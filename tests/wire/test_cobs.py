"""Byte stuffing: the examples of the method's authors, and what holds for any bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from campaign.wire import cobs
from campaign.wire.codes import WireError

RUN = bytes(range(1, 256))


@pytest.mark.parametrize(
    ("plain", "encoded"),
    [  # by hand, after Cheshire and Baker 1999
        ("", "01"),
        ("00", "0101"),
        ("0000", "010101"),
        ("11220033", "0311220233"),
        ("11000000", "0211010101"),
        ("4500002c4c79000040064f37", "0245010 42c4c79 01 0540064f37".replace(" ", "")),
        (RUN[:254].hex(), "ff" + RUN[:254].hex()),
        ("00" + RUN[:254].hex(), "01ff" + RUN[:254].hex()),
        (RUN.hex(), "ff" + RUN[:254].hex() + "02ff"),
        (RUN[1:].hex() + "00", "ff" + RUN[1:].hex() + "0101"),
        (RUN[2:].hex() + "0001", "fe" + RUN[2:].hex() + "0201"),
    ],
)
def test_known_encodings(plain: str, encoded: str) -> None:
    assert cobs.encode(bytes.fromhex(plain)).hex() == encoded
    assert cobs.decode(bytes.fromhex(encoded)).hex() == plain


@given(st.lists(st.binary(max_size=30) | st.binary(min_size=253, max_size=256), max_size=4))
def test_every_encoding_is_without_zeros_within_its_bound_and_reversible(
    parts: list[bytes],
) -> None:
    for data in (b"".join(parts), b"\0".join(parts), b"".join(parts).replace(b"\0", b"\x01")):
        encoded = cobs.encode(data)
        assert 0 not in encoded
        assert len(encoded) <= cobs.encoded_length(len(data))
        assert cobs.decode(encoded) == data


@pytest.mark.parametrize("encoded", ["", "00", "02", "0311", "02110501", "031100"])
def test_what_no_encoder_makes_is_refused(encoded: str) -> None:
    with pytest.raises(WireError):
        cobs.decode(bytes.fromhex(encoded))
