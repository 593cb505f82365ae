"""What pages are sent: all of it in order, to each at its own pace."""

from tests.unit.views.conftest import LM629
from tests.unit.views.scope.decoded import Seen
from vbus.board.build import load_board_text
from vbus.views.scope import stream as made
from vbus.views.scope.frames import ALL, LABELS, NOW, frame, texts
from vbus.views.scope.lanes import Lanes, Lateness
from vbus.views.scope.stream import Stream


def labels(text: str) -> bytes:
    return frame(LABELS, ALL, 1, 0, texts([text]))


def now(when: int) -> bytes:
    return frame(NOW, ALL, 0, when)


def test_each_page_gets_all_that_came_since_its_place() -> None:
    stream = Stream({})
    assert stream.after(0) == (b"", 0)
    stream.add(now(1))
    stream.add(now(2))
    assert stream.after(0) == (now(1) + now(2), 2)
    assert stream.after(1) == (now(2), 2)
    stream.add(now(3))
    assert stream.after(2) == (now(3), 3)
    assert stream.after(3) == (b"", 3)


def test_where_there_is_too_much_the_oldest_is_left_out_but_no_label() -> None:
    stream = Stream({}, most=3 * len(now(0)))
    for text in ("a", "b"):
        stream.add(labels(text))
        for when in range(3):
            stream.add(now(when))
    assert stream.after(0) == (labels("a") + labels("b") + now(0) + now(1) + now(2), 8)
    assert stream.after(1) == (labels("b") + now(0) + now(1) + now(2), 8)
    assert stream.after(6) == (now(1) + now(2), 8)


def test_a_page_is_told_up_to_when_all_is_left_out() -> None:
    lanes = Lanes(load_board_text(LM629), False, Lateness())
    description = lanes.described(live=True)
    second = 1_000_000_000_000
    stream = Stream(description, most=3 * len(now(0)))
    for when in range(1, 4):
        stream.add(now(when * second))
    assert Seen(description, stream.after(0)[0]).rows["left out"] == []
    for when in range(4, 6):
        stream.add(now(when * second))
    message, place = stream.after(0)
    ((when, mark),) = Seen(description, message).rows["left out"]
    assert (when, mark["kind"]) == (2 * second, "gap")
    assert mark["text"].startswith("all before 2.000 s is left out: the scope keeps ")
    assert stream.after(place) == (b"", place), "a page that follows misses nothing"


def test_what_is_longer_than_all_that_is_kept_is_sent_all_the_same() -> None:
    stream = Stream({}, most=1)
    stream.add(now(1))
    stream.add(now(2))
    assert stream.after(0) == (now(2), 2)


def test_much_goes_in_several_messages(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(made, "MESSAGE", 20)
    stream = Stream({}, most=None)
    for when in range(5):
        stream.add(now(when))
    assert stream.after(0) == (now(0) + now(1), 2)
    assert stream.after(2) == (now(2) + now(3), 4)
    assert stream.after(4) == (now(4), 5)
