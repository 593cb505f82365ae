"""The table of the byte protocol."""

import pytest

from vbus.core.row_table import RowTable
from vbus.protocols import codes
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.requests import (
    FATAL,
    REFUSALS,
    REPLIES,
    REQUESTS,
    UNASKED,
    Field,
    PayloadLayout,
    Request,
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "values", "wire"),
    [
        ("HELLO", (1,), "0101"),
        ("ECHO", (0x5A,), "025a"),
        ("SELECT", (0x0103,), "030103"),
        ("CLAIM", (), "04"),
        ("UNCLAIM", (), "05"),
        ("READ4", (0xF,), "1f"),
        ("WRITE4", (0x1, 0xAB), "21ab"),
        ("READ", (0x80,), "3080"),
        ("WRITE", (0x80, 0xAB), "3180ab"),
        ("READS", (1, 255), "3201ff"),
        ("WRITES", (1, b"\x0a\x0b\x0c"), "3301030a0b0c"),
        ("WAIT", (15_000_000,), "340000000000e4e1c0"),
        ("LINES", (0x8001, 0x0001), "4080010001"),
        ("DRIVE", (0x55,), "4155"),
        ("RELEASE", (), "42"),
        ("SAMPLE", (), "43"),
        ("PIN", (3, 2), "440302"),
        ("GETPIN", (3,), "4503"),
        ("DELAY", (1,), "500000000000000001"),
        ("AT", ((1 << 64) - 1,), "51ffffffffffffffff"),
        ("NOW", (), "52"),
        ("SYNC", (), "53"),
        ("POLLED", (1, 0x0102), "54010102"),
        ("POLLED_AT", (1, 5, b"\0\0\1\2"), "5501" + "0000000000000005" + "0400000102"),
        ("PASS", (1,), "560000000000000001"),
        ("EVENTS", (0x80000001,), "6080000001"),
        ("LEASES", (1,), "6101"),
    ],
)
def test_a_request_has_the_bytes_the_protocol_says(
    name: str, values: tuple[int | bytes, ...], wire: str
) -> None:
    assert REQUESTS[name].pack(*values).hex() == wire


def test_the_table_has_no_other_requests() -> None:
    assert len(list(REQUESTS)) == 27


def test_every_request_has_one_handler_and_every_handler_a_request() -> None:
    handlers = {name for name in vars(ByteProtocol) if name.startswith("_do_")}
    rows = {"_do_" + row.name.lower() for row in REQUESTS if row.name != "READ4"}
    assert handlers == rows | {"_do_unknown"}


def test_every_answer_is_a_known_reply() -> None:
    assert {row.reply for row in REQUESTS} - {""} == set(REPLIES) - {"L", "M", "X", *UNASKED}


def test_reply_tags_are_letters_and_never_opcodes_of_short_cycles() -> None:
    assert all(reply.tag.isalpha() and reply.code >= 0x40 for reply in REPLIES.values())


def test_every_reason_to_refuse_has_a_sentence() -> None:
    reasons = {value for name, value in vars(codes).items() if name.isupper()}
    assert set(REFUSALS) == reasons == {1, 2, 3, 4, 5, 6, 7, 8}
    assert {1, 4, 5} == FATAL


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("READ", (256,), "a = 256: allowed are 0 to 255"),
        ("SELECT", (-1,), "mask = -1: allowed are 0 to 65535"),
        ("READ4", (16,), "address = 16: allowed are 0 to 15"),
        ("WRITES", (0, b"\0" * 256), "data = 256: allowed are 0 to 255"),
        ("DRIVE", (), "0 values for 1 fields"),
    ],
)
def test_a_value_that_does_not_fit_is_named_with_what_is_allowed(
    name: str, values: tuple[int | bytes, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        REQUESTS[name].pack(*values)


def test_an_opcode_given_twice_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^1FH is B and A$"):
        RowTable(Request("A", 0x10, "", span=16), Request("B", 0x1F, ""))


def test_a_name_given_twice_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^A stands in the table twice$"):
        RowTable(Request("A", 0x10, ""), Request("A", 0x11, ""))


def test_a_run_of_bytes_may_stand_behind_numbers() -> None:
    layout = PayloadLayout(Field("a", "u8"), Field("data", "bytes8"))
    assert layout.counted
    assert layout.size == 2
    assert Request("X", 1, "", layout).size == 3


def test_a_run_of_bytes_must_stand_last() -> None:
    with pytest.raises(ValueError, match=r"^a run of bytes must stand last$"):
        PayloadLayout(Field("data", "bytes8"), Field("a", "u8"))
