"""Faults of a board file."""

import pytest

from tests.unit.faults.bench import DC, LM, Lm, build, settle
from vbus.board.source import BoardFileError
from vbus.kernel import MS


def test_a_fault_of_the_file_is_armed_before_power_comes() -> None:
    board = build(LM, DC, '[[faults]]\nfault = "power_on_c4"\n', power_on="reset")
    host = Lm(board)
    settle(board, 3)
    assert host.status() == 0xC4


def test_its_keys_are_those_of_the_call() -> None:
    board = build(
        LM,
        DC,
        '[[faults]]\nfault = "load_step"\ntarget = "x"\nwhen = "at 5 ms"\nuntil = "for 2 ms"\n'
        'torque = "5 mN*m"\n',
    )
    (fault,) = board.faults.all()
    assert (fault.name, fault.target, fault.values) == ("load_step", "x.1", {"torque": 0.005})
    board.run_until(6 * MS)
    assert fault.state == "acting"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('fault = "jamm"', 'faults[1].fault: there is no fault "jamm"; did you mean "jam"?'),
        ('fault = "slip"\nshar = 0.5', 'faults[1].shar: unknown key; did you mean "share"?'),
        ('fault = "slip"\nshare = 2', "faults[1].share: found 2; out of range"),
        ('fault = "jam"\nwhen = "at 5"', "faults[1].when: it has no unit"),
        ('fault = "jam"\nuntil = "once"', 'faults[1].until: until = "once": jam lasts'),
        ('fault = "jam"\ntarget = "y"', "faults[1]: no chip called 'y'"),
        ('target = "x"', 'faults[1]: key "fault" is missing'),
        ('fault = "supply_dip"\nwhen = "command LTRI"', 'did you mean "LTRJ"?'),
    ],
)
def test_a_mistake_is_told_with_its_line(text: str, message: str) -> None:
    with pytest.raises(BoardFileError) as error:
        build(LM, DC, f"[[faults]]\n{text}\n")
    assert message in str(error.value)
    assert "board.toml:" in str(error.value)


def test_a_table_in_place_of_the_list_is_refused() -> None:
    with pytest.raises(BoardFileError, match="this is a list of tables"):
        build(LM, DC, '[faults]\nfault = "jam"\n')
