"""Hypothesis strategies made from the protocols' own grammars, and from breaking them."""

from hypothesis import strategies as st

from vbus.core.kernel import US
from vbus.protocols.requests import REQUESTS, Request
from vbus.protocols.text import VERBS

NUMBERS = {
    "u8": st.one_of(st.integers(0, 3), st.integers(0, 255)),
    "u16": st.one_of(st.integers(0, 7), st.integers(0, 0xFFFF)),
    "u32": st.one_of(st.integers(0, 7), st.integers(0, 0xFFFFFFFF)),
    "u64": st.one_of(st.integers(0, 40 * US), st.integers(0, (1 << 64) - 1)),
    "bytes8": st.one_of(st.binary(min_size=1, max_size=5), st.binary(max_size=255)),
}


def of_row(row: Request) -> st.SearchStrategy[bytes]:
    parts: list[st.SearchStrategy[int | bytes]] = [
        NUMBERS[part.kind]  # type: ignore[misc]
        for part in row.layout.fields
    ]
    if row.span > 1:
        parts.insert(0, st.integers(0, row.span - 1))
    return st.tuples(*parts).map(lambda values: row.pack(*values))


requests = st.sampled_from(list(REQUESTS)).flatmap(of_row)
"""One request of the byte protocol, with likely and with absurd arguments."""

streams = st.lists(st.one_of(*[requests] * 12, st.binary(min_size=1, max_size=3)), max_size=12).map(
    b"".join
)
"""Requests in a row, now and then with garbage between them."""

cuts = st.lists(st.integers(1, 40), min_size=1, max_size=12)
"""Sizes of the pieces a stream is cut into; used over and over."""


def pieces(stream: bytes, sizes: list[int]) -> list[bytes]:
    """Cut ``stream`` into pieces of the given sizes."""
    result = []
    start = turn = 0
    while start < len(stream):
        size = sizes[turn % len(sizes)]
        result.append(stream[start : start + size])
        start += size
        turn += 1
    return result


words = st.one_of(
    st.sampled_from([*VERBS, "x", "y", "x./RST", "/RD=0", "/WR=1", "all", "none", "0", "1", "z"]),
    st.sampled_from(["1f", "0x340", "348", "ff", "100", "100us", "1.5ms", "9999999s", "-1", "="]),
    st.text(max_size=4),
)
lines = st.one_of(
    st.lists(words, max_size=5).map(" ".join),
    st.tuples(st.sampled_from(list(VERBS)), words, words).map(" ".join),
).map(lambda text: text.replace("\r", "").replace("\n", "").encode())
"""Lines of words: what a person or a script may get wrong."""

ends = st.sampled_from([b"\n", b"\r", b"\r\n"])
