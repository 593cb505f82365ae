"""Scenarios: what hosts do, written down beforehand with its instants."""

from dataclasses import dataclass
from operator import attrgetter

from vbus.circuit.orders import PIN, READ, WRITE, Order
from vbus.core.errors import ConfigError
from vbus.core.kernel import END
from vbus.protocols.port import PIN_LEVELS
from vbus.protocols.quantities import parse_duration


@dataclass(frozen=True, slots=True)
class Scenario:
    """A list of orders, and how long the run takes.

    Attributes:
        orders: in order of their instants.
        until: end of the run (ps).
    """

    orders: tuple[Order, ...]
    until: int

    def of(self, chips: set[str]) -> list[Order]:
        """Return the orders for some chips: those of one node."""
        return [order for order in self.orders if order.chips[0] in chips]


def read_scenario(text: str, file: str, chips: dict[str, set[str]], cycle: int) -> Scenario:
    """Read a scenario: one line, one instant, one chip, one request; ``#`` begins a comment.

    ``1.5ms x w 0 1f 00`` writes 1Fh and 00h at address 0 of chip x, the first byte latched at
    1.5 ms and the next a cycle later; ``2ms x r 1 4`` reads four times at address 1; ``3ms x pin
    /RST 0`` puts a pin to 0, 1 or z (let go); ``end 20ms`` is where the run ends, else just after
    the last request. Several chips are written together as ``x+y``, whatever nodes they are on.

    Args:
        text: the scenario.
        file: its name in messages.
        chips: pins of every chip that may be named.
        cycle: how long a bus cycle takes (ps).

    Raises:
        ConfigError: a line makes no sense; it is named with its number.
    """
    orders: list[Order] = []
    until = -1
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            if words[0] == "end":
                if len(words) != 2:
                    raise ValueError('write "end" and an instant')
                until = parse_duration(words[1])
            else:
                orders += _orders(words, chips, cycle)
        except ValueError as error:
            raise ConfigError(f"{file}:{number}: {error}") from None
    orders.sort(key=attrgetter("when"))
    last = orders[-1].when if orders else 0
    if until < 0:
        until = last + cycle
    if until > END:
        raise ConfigError(f"{file}: it ends at {until} ps, and time ends at {END} ps")
    if until < last:
        raise ConfigError(f"{file}: it ends at {until} ps, and a request stands at {last} ps")
    return Scenario(tuple(orders), until)


def _orders(words: list[str], chips: dict[str, set[str]], cycle: int) -> list[Order]:
    if len(words) < 4:
        raise ValueError("write an instant, a chip, a request and what belongs to it")
    when = parse_duration(words[0])
    names = tuple(words[1].split("+"))
    for name in names:
        if name not in chips:
            raise ValueError(f"no chip called {name!r}; there are {', '.join(chips)}")
    verb, rest = words[2], words[3:]
    if verb != "w" and len(names) > 1:
        raise ValueError("only writes go to several chips at once")
    if verb == "w" and len(rest) > 1:
        address = _byte(rest[0], "address")
        return [
            Order(when + n * cycle, (name,), WRITE, address, _byte(word, "data"))
            for n, word in enumerate(rest[1:])
            for name in names
        ]
    if verb == "r" and len(rest) < 3:
        address = _byte(rest[0], "address")
        count = _byte(rest[1], "count") if len(rest) > 1 else 1
        return [Order(when + n * cycle, names, READ, address) for n in range(count)]
    if verb == "pin" and len(rest) == 2:
        pin, level = rest
        if pin not in chips[names[0]]:
            known = ", ".join(sorted(chips[names[0]]))
            raise ValueError(f"{names[0]} has no pin {pin!r}; it has {known}")
        if level not in PIN_LEVELS:
            raise ValueError(f"level {level!r}: allowed are 0, 1 and z (let go)")
        return [Order(when, names, PIN, 0, PIN_LEVELS[level], pin)]
    raise ValueError(
        f"unknown request {' '.join(words[2:])!r}; allowed are: w ADDRESS DATA ..., r ADDRESS"
        " [COUNT], pin NAME 0|1|z (numbers are hexadecimal)"
    )


def _byte(word: str, what: str) -> int:
    try:
        value = int(word, 16)
    except ValueError:
        value = -1
    if not 0 <= value <= 0xFF:
        raise ValueError(f"{what} {word!r} is no hexadecimal number from 0 to FF")
    return value
