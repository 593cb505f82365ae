"""What packets are called."""

from vbus.events.names import unknown_packet

KNOWN = ["STT", "FLAG", "adapter status"]


def test_a_packet_is_called_by_its_name_or_the_last_word_of_it() -> None:
    for name in ("STT", "write FLAG", "adapter status", "status", "reserved command 1AH"):
        assert unknown_packet(name, KNOWN) == ""
    assert unknown_packet("stt", KNOWN).startswith('"stt"; did you mean "STT"? there are')
    assert unknown_packet("adapter", KNOWN).startswith('"adapter"; ')
