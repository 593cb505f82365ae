"""Nets and pins: drive, release, open drain, contention, watchers."""

from vbus.core.kernel import Kernel
from vbus.core.signals import HIGH, LOW, Net, Observer, Watcher, Z
from vbus.core.signals.wire import WireEnd


class Edges(Observer):
    def __init__(self) -> None:
        self.seen: list[tuple[int, str, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((when, net, level))


def test_an_undriven_net_rests_at_its_pull() -> None:
    kernel = Kernel()

    assert Net(kernel, "/RST", rest=HIGH).value == HIGH
    assert Net(kernel, "HI", rest=LOW).value == LOW


def test_a_released_pin_gives_the_net_back_to_its_pull() -> None:
    net = Net(Kernel(), "/RST", rest=HIGH)
    pin = net.solder("/RST")

    pin.drive(LOW)
    assert net.value == LOW

    pin.release()
    assert net.value == HIGH


def test_a_floating_bus_without_a_pull_keeps_its_last_value() -> None:
    net = Net(Kernel(), "D0-D7", rest=Z, width=8)
    pin = net.solder("D0-D7")

    pin.drive(0xA5)
    pin.release()

    assert net.value == 0xA5


def test_a_bundle_keeps_its_history_when_somebody_begins_to_listen() -> None:
    kernel = Kernel()
    net = Net(kernel, "D0-D7", rest=Z, width=8)
    pin = net.solder("D0-D7")
    for when, level in ((5, 0xA5), (9, Z)):
        kernel.run_until(when)
        pin.drive(level)
    kernel.run_until(20)
    net.observe(Edges())
    assert (net.changed_at, net.let_go_at) == (5, 9)


def test_open_drain_pins_share_a_wire_and_any_of_them_pulls_it_low() -> None:
    net = Net(Kernel(), "/INT", rest=HIGH)
    pins = [net.solder("/INT", open_drain=True) for _ in range(3)]
    clashes: list[Net] = []
    net.clash = clashes.append

    for pin in pins:
        pin.drive(HIGH)
    assert net.value == HIGH

    pins[1].drive(LOW)
    assert net.value == LOW

    pins[1].drive(HIGH)
    assert net.value == HIGH
    assert clashes == []


def test_two_outputs_that_disagree_are_reported_once_and_low_wins() -> None:
    net = Net(Kernel(), "D0-D7", rest=Z, width=8)
    one, two = net.solder("one"), net.solder("two")
    clashes: list[str] = []
    net.clash = lambda n: clashes.append(n.name)

    one.drive(0xF0)
    two.drive(0x3C)
    assert net.value == 0x30
    assert clashes == ["D0-D7"]

    two.drive(0xF0)
    two.drive(0x0F)
    assert clashes == ["D0-D7", "D0-D7"]


def test_several_lines_moved_together_are_one_event_to_a_watcher() -> None:
    kernel = Kernel()
    nets = [Net(kernel, name) for name in ("/CS", "/RD")]
    pins = [net.solder(net.name) for net in nets]
    calls: list[tuple[int, int]] = []
    watcher = Watcher(kernel, lambda: calls.append((nets[0].value, nets[1].value)))
    for net in nets:
        net.watch(watcher)

    pins[0].drive(LOW)
    pins[1].drive(LOW)
    assert calls == []

    kernel.settle()
    assert calls == [(LOW, LOW)]


def test_an_observer_sees_every_edge_with_its_instant() -> None:
    kernel = Kernel()
    net = Net(kernel, "x.HI", rest=LOW)
    pin = net.solder("HI")
    edges = Edges()
    net.observe(edges)

    kernel.run_until(100)
    pin.drive(HIGH)
    kernel.run_until(250)
    pin.drive(HIGH)
    pin.drive(LOW)

    assert edges.seen == [(100, "x.HI", HIGH), (250, "x.HI", LOW)]


def test_a_net_remembers_the_level_before_its_last_change() -> None:
    kernel = Kernel()
    net = Net(kernel, "D0-D7", rest=0, width=8)
    pin = net.solder("D0-D7")

    pin.drive(0x1F)
    kernel.run_until(70)
    pin.drive(0x20)

    assert (net.previous, net.value, net.changed_at) == (0x1F, 0x20, 70)


def test_an_output_pin_learns_that_somebody_listens() -> None:
    kernel = Kernel()
    net = Net(kernel, "HI")
    pin = net.solder("HI")
    heard: list[bool] = []
    pin.on_heard = lambda: heard.append(net.heard)
    edges = Edges()

    net.observe(edges)
    net.unobserve(edges)

    assert heard == [True, False]


def test_an_output_is_asked_for_its_level_before_somebody_fights_it() -> None:
    net = Net(Kernel(), "HI")
    pin = net.solder("HI")
    clashes: list[int] = []
    net.clash = lambda net: clashes.append(net.value)
    asked: list[int] = []

    def show() -> None:
        asked.append(net.value)
        pin.drive(HIGH)

    pin.on_heard = show
    switch = net.solder("switch")

    switch.drive(LOW)
    assert (asked[0], clashes, net.value) == (HIGH, [HIGH], LOW)

    asked.clear()
    switch.drive(HIGH)
    assert (asked, net.value) == ([], HIGH)


def test_a_pin_soldered_to_another_net_takes_its_watchers_along() -> None:
    kernel = Kernel()
    old, shared = Net(kernel, "a./SYNC"), Net(kernel, "/SYNC")
    pin = old.solder("/SYNC")
    calls: list[int] = []
    old.watch(Watcher(kernel, lambda: calls.append(shared.value)))
    driver = shared.solder("host")

    pin.move(shared)
    driver.drive(LOW)
    kernel.settle()

    assert calls == [LOW]
    assert pin.value == LOW


def test_what_moves_together_with_an_edge_is_known_by_its_level_before() -> None:
    kernel = Kernel()
    data, strobe = Net(kernel, "D0-D7", rest=0, width=8), Net(kernel, "/WR")
    data_pin, strobe_pin = data.solder("D0-D7"), strobe.solder("/WR")
    taken: list[int] = []
    strobe.watch(Watcher(kernel, lambda: taken.append(data.before)))

    data_pin.drive(0x11)
    kernel.settle()
    strobe_pin.drive(LOW)
    kernel.settle()
    data_pin.drive(0x22)
    strobe_pin.drive(HIGH)
    kernel.settle()
    strobe_pin.drive(LOW)
    kernel.settle()

    assert taken == [0x11, 0x11, 0x22]


def test_a_chip_is_told_when_a_part_begins_to_drive_its_wire_and_when_that_lets_go() -> None:
    net = Net(Kernel(), "/INT", rest=HIGH)
    told: list[bool] = []
    net.solder("chip").on_heard = lambda: told.append(net.contested)
    part = net.solder("part")
    for level in (LOW, HIGH, Z):
        part.drive(level)
    assert (told[0], told[-1]) == (True, False)


def test_an_end_of_a_wire_tells_the_others_what_changes_and_nothing_else() -> None:
    outbox: list[tuple[int, int, int, bool]] = []
    end = WireEnd(Kernel(), "/SYNC", 3, outbox)
    strong, weak = end.solder("a"), end.solder("b", open_drain=True)
    end.resolve()
    assert outbox == []
    strong.drive(LOW)
    end.resolve()
    weak.drive(LOW)
    assert outbox == [(0, 3, LOW, False)]
    strong.release()
    assert outbox[1:] == [(0, 3, LOW, True)]
    end.resolve()
    weak.release()
    assert outbox[2:] == [(0, 3, Z, False)]


def test_a_wire_that_was_put_to_a_level_has_no_history() -> None:
    kernel = Kernel()
    net = Net(kernel, "D0-D7", rest=Z, width=8)
    pin = net.solder("D0-D7")
    kernel.run_until(70)
    pin.drive(0x5A)
    kernel.run_until(90)
    pin.release()
    assert net.history[1:] == (70, 90)
    net.put(0x33)
    assert net.value == 0x33
    assert net.history == (0x33, 0, -1)  # nobody has let go of it
