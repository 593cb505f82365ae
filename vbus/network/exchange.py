"""The board's end of one host's messages: carried out in order, and each one once."""

from collections.abc import Callable
from typing import Final, NamedTuple

from vbus.network.envelope import GONE, WINDOW

Answer = Callable[[bytes], None]
"""Sends a reply."""
Refuse = Callable[[str, str], None]
"""Sends a refusal: a code and a sentence."""

MOST_STORED: Final = 16 << 20
"""Bytes of replies stored for a host that does not acknowledge them: a bound of memory."""


class _Received(NamedTuple):
    """A message that came, and the way back to its host."""

    data: bytes
    answer: Answer
    refuse: Refuse


class Exchange:
    """Puts a host's messages in order, and remembers replies until they are acknowledged.

    Args:
        carry_out: takes the next message's bytes; :meth:`done` is called when its reply is there,
            before it returns or later.

    Attributes:
        following: number of the next message to be carried out.
    """

    def __init__(self, carry_out: Callable[[bytes], None]) -> None:
        self._carry_out: Callable[[bytes], None] = carry_out
        self.following: int = 0
        self._arrived: dict[int, _Received] = {}
        self._current: _Received | None = None
        self._stored: dict[int, bytes] = {}
        self.unacknowledged: int = 0
        """Bytes of replies that the host has not acknowledged."""
        self._running: bool = False
        self._ended: str = ""

    def take(
        self, number: int, acknowledged: int, data: bytes, answer: Answer, refuse: Refuse
    ) -> None:
        """Take a message, whatever its turn."""
        if self._ended:
            refuse(GONE, self._ended)
            return
        self._forget(acknowledged)
        message = _Received(data, answer, refuse)
        # A repeated message whose reply was lost: the bus cycles are not made again.
        if number in self._stored:
            answer(self._stored[number])
        elif number == self.following - 1 and self._current is not None:
            # Being carried out: the repeated query waits for the reply in place of the first.
            self._current = message
        elif number < self.following:
            refuse(GONE, f"message {number} has been carried out; its reply is no longer stored")
        # A bound of memory: no host has more under way.
        elif number >= self.following + WINDOW:
            refuse(GONE, f"message {number} came before message {self.following}: too far ahead")
        else:
            self._arrived[number] = message
            self._run()

    def missing(self, end: int) -> str:
        """Say which messages before number ``end`` have not come, "message 3 has"; else nothing."""
        numbers = range(self.following, min(end, self.following + WINDOW))
        lacking = [number for number in numbers if number not in self._arrived]
        if not lacking:
            return ""
        if len(lacking) == 1:
            return f"message {lacking[0]} has"
        return f"{len(lacking)} messages from {lacking[0]} to {lacking[-1]} have"

    def _forget(self, acknowledged: int) -> None:
        if self._stored and acknowledged:
            for number in [number for number in self._stored if number < acknowledged]:
                self.unacknowledged -= len(self._stored.pop(number))

    def _run(self) -> None:
        """Carry out what is next, as long as it is here."""
        if self._running:
            return
        # done() may be called within carry_out: without this each message would nest in the last.
        self._running = True
        try:
            while self._current is None and not self._ended:
                message = self._arrived.pop(self.following, None)
                if message is None:
                    break
                self._current = message
                self.following += 1
                self._carry_out(message.data)
        finally:
            self._running = False

    def done(self, reply: bytes) -> None:
        """The message being carried out has its reply."""
        message = self._current
        if message is None:
            return
        self._current = None
        self._stored[self.following - 1] = reply
        self.unacknowledged += len(reply)
        # The newest stays whatever its size: the host may have to ask for it again.
        while self.unacknowledged > MOST_STORED and len(self._stored) > 1:
            first = next(iter(self._stored))
            self.unacknowledged -= len(self._stored.pop(first))
        message.answer(reply)
        self._run()

    def leave(self) -> list[bytes]:
        """Take what waits for its turn, up to the first message that has not come.

        The host has said good-bye: these messages, and the one being carried out, are answered
        with nothing, which says that the board has them; it carries them out, long ones in turns.
        """
        current, self._current = self._current, None
        messages = [] if current is None else [current]
        left = []
        while (message := self._arrived.pop(self.following, None)) is not None:
            self.following += 1
            left.append(message.data)
            messages.append(message)
        for message in messages:
            message.answer(b"")
        return left

    def end(self, code: str, reason: str) -> None:
        """Refuse whatever waits, and whatever comes."""
        if self._ended:
            return
        self._ended = reason
        waiting = [*self._arrived.values()]
        if self._current is not None:
            waiting.insert(0, self._current)
        self._arrived.clear()
        self._stored.clear()
        self._current = None
        for message in waiting:
            message.refuse(code, reason)
