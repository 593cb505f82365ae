"""What the MCP-1200 takes differently of a driver for the HCTL-1100, cycle by cycle."""

import pytest

from vbus.chips.mcp1200.compatible import Hctl1100Uses

NO_TIMER = (
    "a sample of {} clocks, not of {}; write R10, R11 first, or run it at four times the clock"
)


@pytest.mark.parametrize(
    ("cycles", "found"),
    [
        ("w0F=40", ("prescaler", f"R0F = 40: {NO_TIMER.format(4160, 1040)}")),
        ("w0F=00", ("prescaler", f"R0F = 00: {NO_TIMER.format(64, 16)}")),
        ("w10=00 w0F=40", None),
        ("w11=0F w0F=40", None),
        ("w22=08", None),
        ("w23=00", ("velocity-order", "R23 = 00 is another byte of it here")),
        ("w24=01", ("velocity-order", "R24 = 01 is another byte of it here")),
        ("w25=01", None),
        ("w17=01", None),
        ("w18=20", ("commutator", "R18 = 20 sets up no commutator here")),
        ("w1F=20", ("commutator", "R1F = 20 sets up no commutator here")),
        ("w20=E5", None),
        ("w05=02", ("align", "R05 = 02 halts the motion; leave it out")),
        ("w05=03", None),
        ("w45=02", ("align", "R05 = 02 halts the motion; leave it out")),
        ("w00=0A", ("unipolar", "0Ah does nothing here; set bit 2 of R01")),
        ("w00=0B",
         ("proportional", "0Bh begins velocity interpolation; use F5, integral velocity")),
        ("w00=0C", ("hold-commutator", "0Ch begins position interpolation; leave it out")),
        ("w00=02", None),
        ("w00=03", None),
        ("w00=04", None),
        ("w00=08", None),
        ("w00=0D", None),
        ("r12", ("position-order", "R12 is read before R14; read R14 first")),
        ("r13", ("position-order", "R13 is read before R14; read R14 first")),
        ("r14", None),
        ("r14 r13 r12", None),
        ("r14 r12 r12", ("position-order", "R12 is read before R14; read R14 first")),
        ("w14=00 r13", ("position-order", "R13 is read before R14; read R14 first")),
        ("r05", None),
    ],
)  # fmt: skip
def test_what_is_noted_of_the_last_of_some_cycles(
    cycles: str, found: tuple[str, str] | None
) -> None:
    uses = Hctl1100Uses()
    for cycle in cycles.split():
        address, _, data = cycle[1:].partition("=")
        notes = list(uses.cycle(cycle[0] == "w", int(address, 16), int(data or "0", 16)))
    assert [(rule.name.removeprefix("mcp1200.hctl-1100."), detail) for rule, detail in notes] == (
        [found] if found else []
    )
