"""Faults of a board file."""

import pytest

from tests.unit.faults.bench import DC, LM, Lm, build, settle
from vbus.boardfile.source import BoardFileError
from vbus.core.kernel import MS


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
        ('fault = "jam"\nwhen = "at 5"', 'faults[1].when: found "at 5"; it has no unit'),
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


HOSTS = '[[hosts]]\ntransport = "pty:x"\n[[hosts]]\ntransport = "zenoh:"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"message_lost"', "faults[1].target: message_lost: host0 (pty:x) is a stream of bytes"),
        ('"link_cut"\ntarget = "host0"', "link_cut: host0 (pty:x) is a stream of bytes"),
        ('"half_answer"\ntarget = "host1"', "half_answer: host1 (zenoh:) carries messages"),
        ('"message_lost"\nway = "there"', 'found "there"; allowed are "request", "reply"'),
        ('"answer_lost"\ntarget = "host"', 'target "host": write "host0"'),
        ('"answer_lost"\ntarget = "hostess"', 'target "hostess": write "host0"'),
        ('"message_lost"\nevery = 0', "faults[1].every: found 0; out of range"),
        ('"messages_reordered"\nevery = 2', "faults[1].every: unknown key"),
        ('"messages_late"\nuntil = "once"', "messages_late lasts"),
    ],
)
def test_a_fault_that_a_link_cannot_have_is_told_with_its_line(text: str, message: str) -> None:
    with pytest.raises(BoardFileError) as error:
        build(LM, DC, f"{HOSTS}[[faults]]\nfault = {text}\n")
    assert message in str(error.value)
    assert "board.toml:" in str(error.value)


def test_a_link_has_the_faults_it_can_have() -> None:
    names = ("messages_late", "message_lost", "message_doubled", "messages_reordered", "link_cut")
    text = "".join(
        f'[[faults]]\nfault = "{name}"\ntarget = "host{place}"\nwhen = "at 1 s"\n'
        for place, own in enumerate((("half_answer", "link_dead"), (*names, "link_dead")))
        for name in own
    )
    assert len(build(LM, DC, HOSTS + text).faults.all()) == 8


def test_a_table_in_place_of_the_list_is_refused() -> None:
    with pytest.raises(BoardFileError, match="this is a list of tables"):
        build(LM, DC, '[faults]\nfault = "jam"\n')


def test_a_fault_without_a_name_is_refused() -> None:
    with pytest.raises(BoardFileError, match=r'faults\[1\].fault: there is no fault ""; known are'):
        build(LM, DC, '[[faults]]\nfault = ""\n')
