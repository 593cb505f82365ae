"""Hosts that come, ask, stall, send halves, die and come again."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from tests.simulation.system import End, Slave, System, Terminal
from tests.simulation.transcript import Transcript, Wrong

GAPS_NS: Final = (0, 1_000, 30_000, 400_000, 6_000_000)


class Host:
    """One host that uses an entry of the board file, connection after connection.

    Args:
        system: what it runs on.
        name: for people.
        path: name of the terminal, or of the socket.
        terminal: which of both it is.
        wants: adds a request to a transcript.
        manners: how it behaves: chances of what it may do at a turn.

    Attributes:
        transcripts: of all its connections.
    """

    def __init__(
        self,
        system: System,
        name: str,
        path: Path,
        terminal: bool,
        wants: Callable[[Transcript], None],
        manners: dict[str, float],
    ) -> None:
        self._system = system
        self._random = system.random
        self._name = name
        self._path = str(path)
        self._terminal = terminal
        self._wants = wants
        self._manners = manners
        self._end: End | Slave | None = None
        self._half_closed = False
        self._left: Terminal | None = None
        """The terminal it has had last."""
        self.unheard = False
        """Whether answers may be lost: from the first broken link on."""
        self.done = False
        """Whether it comes no more."""
        self.transcripts: list[Transcript] = []

    @property
    def connected(self) -> bool:
        return self._end is not None

    @property
    def transcript(self) -> Transcript:
        return self.transcripts[-1]

    def begin(self) -> None:
        self._system.after(self._random.choice(GAPS_NS), self._turn)

    def _turn(self) -> None:
        if not self.done:
            self.act()
            self._system.after(
                self._random.choice(GAPS_NS) + self._random.randrange(1000), self._turn
            )

    def lose_answers(self, entry: str) -> None:
        """A fault acts on a link: if it is this host's, what is answered is not all it hears."""
        if self._name.startswith(entry):
            self.unheard = True
            for transcript in self.transcripts:
                transcript.whole = False

    # -- what it does ---------------------------------------------------------------------------

    def act(self) -> None:
        """Do one thing."""
        if self._end is None:
            self.connect()
            return
        if self._half_closed and self._random.random() < 0.7:
            return
        draw = self._random.random()
        for name, chance in self._manners.items():
            draw -= chance
            if draw < 0:
                getattr(self, name)()
                return
        self.talk()

    def connect(self) -> None:
        end: End | Slave | None
        if self._terminal:
            end = self._system.open(self._path)
        else:
            end = self._system.connect(self._path)
        self._half_closed = False
        if end is not None:
            self._end = end
            self.transcripts.append(Transcript(f"{self._name}.{len(self.transcripts)}"))
            end.transcript = self.transcript
            self.transcript.whole = not self.unheard
            if isinstance(end, Slave) and end.terminal is self._left:
                # The server has not looked since the one before came; see PtyTransport.
                for transcript in self.transcripts[-2:]:
                    transcript.whole = False

    def talk(self) -> None:
        """Ask a few things, and take what has come."""
        for _ in range(self._random.choice((0, 1, 1, 3, 20))):
            if len(self.transcript.unsent()) < 200:
                self._wants(self.transcript)
        self.send(1 << 16)
        self.listen()

    def send(self, most: int) -> None:
        """Send of what is to be sent as much as the other end takes."""
        data = self.transcript.unsent()[:most]
        if self._end is None or not data or self._half_closed:
            return
        try:
            self.transcript.sent += self._end.write(data)
        except BlockingIOError:
            pass
        except OSError:
            self.leave()

    def listen(self) -> bool:
        """Take what has come; tell whether there may be more."""
        if self._end is None:
            return False
        try:
            data = self._end.read(self._random.choice((1, 100, 1 << 16)))
        except BlockingIOError:
            return False
        except OSError:
            data = b""
        if data:
            self.transcript.take(data)
            return True
        self.leave()
        return False

    def half(self) -> None:
        """Send a piece of what is to be sent."""
        self._wants(self.transcript)
        self.send(self._random.randrange(1, 12))

    def stall(self) -> None:
        """Ask and read nothing."""
        self._wants(self.transcript)
        self.send(1 << 16)

    def garble(self) -> None:
        """Send what is no request."""
        self.transcript.garbage(bytes((0xFF, self._random.randrange(256))))

    def half_close(self) -> None:
        """Ask for a lot, send no more, and read on, slowly."""
        if isinstance(self._end, End):
            for _ in range(self._random.choice((0, 20))):
                self._wants(self.transcript)
            self.send(1 << 16)
            self._half_closed = True
            if self._end is not None:
                self._end.shut()

    def share(self) -> None:
        """Open the terminal a second time, and close one of both."""
        if isinstance(self._end, Slave):
            terminal = self._end.terminal  # the name may lead elsewhere by now
            if not terminal.exclusive and not terminal.gone:
                second = Slave(self._system, terminal)
                self._end.close()
                second.transcript, self._end = self.transcript, second

    def hog(self) -> None:
        """Take the terminal for itself."""
        if isinstance(self._end, Slave):
            self._end.terminal.exclusive = True

    def leave(self) -> None:
        """Close, or die: it is the same to the system."""
        end, self._end = self._end, None
        if end is not None:
            self._left = end.terminal if isinstance(end, Slave) else None
            end.close()

    def leave_and_come(self) -> None:
        """Be followed by the next before the server can have looked."""
        self.leave()
        self.connect()

    # -- the end --------------------------------------------------------------------------------

    def ask_last(self) -> None:
        """Ask for nothing but to be told that everything is done."""
        if self._end is None or self._half_closed or self._unclear():
            self.leave()
        else:
            self.transcript.ask("UNCLAIM")
            self.transcript.barrier()

    def _unclear(self) -> bool:
        """Whether nobody can say what the last request will be taken for."""
        return self.transcript.lost or not self.transcript.whole

    def go_on_to_the_end(self) -> bool:
        """Send and read until everything is answered; tell whether it is."""
        if self._end is None:
            return True
        self.send(1 << 16)
        while self.listen():
            pass
        if self._end is not None and self.transcript.settled:
            self.transcript.polite_end = self.transcript.whole
            self.leave()
        return self._end is None

    def complain(self) -> None:
        """Say what was not answered.

        Raises:
            Wrong: always.
        """
        transcript = self.transcript
        left = [name for name, *_ in transcript.asked[transcript.answered :]]
        raise Wrong(f"{transcript.name}: these were not answered: {left[:8]}")
