"""One seeded run of the real server, and what must hold at each of its steps.

The server, its sessions, transports, protocols, pacer, recording and event loop are those that run
on a real system; see :mod:`tests.simulation.system` for what is exchanged. Zenoh itself, TCP,
serial devices and processes are left out; hosts that lose and reorder messages are those of
:mod:`tests.simulation.lossy`.
"""

import asyncio
import errno
import io
import logging
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from random import Random
from typing import Any, Final
from unittest import mock

from tests.simulation.hosts import Host
from tests.simulation.lossy import Network, NetworkHost
from tests.simulation.system import (
    End,
    File,
    Inotify,
    SimulatedLoop,
    Slave,
    System,
    Terminal,
    names_in,
)
from tests.simulation.transcript import Transcript, Wrong, ask_something, compare
from tests.unit.faults.bench import DC, LM, MC, MCP, STEPPER
from vbus.board.board import Board
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.boardfile.sections import RecordSection
from vbus.core.kernel import END, MS, SECOND, US
from vbus.core.runtime import private_runtime
from vbus.network import session as network_session
from vbus.protocols.byte import ByteProtocol
from vbus.record.format import JournalError, JournalReader
from vbus.record.replay import Replay
from vbus.serve import recording
from vbus.serve.host_entry import HostEntry
from vbus.serve.recording import Recording
from vbus.serve.server import LinkSpec, Server
from vbus.serve.session import Services
from vbus.serve.time.pacer import WallClockPacer
from vbus.transports import zenoh as zenoh_transport
from vbus.transports.base import Link
from vbus.transports.states import DRAINING
from vbus.transports.zenoh_host import ZenohLink

SECOND_CHIP: Final = (
    (MC + STEPPER).replace("s.x", "s.y").replace("s.m", "s.n").replace('"m"', '"n"')
)
CHIPS: Final = (LM + DC, MCP + DC, MC + STEPPER, LM + DC + SECOND_CHIP)
POLICIES: Final = ("lockstep", "realtime", "slaved")
PLACE: Final = network_session.Network(grace_seconds=0.05)
STEPS: Final = 300_000
"""Looks of the event loop after which a run is taken for one that does not end. A host that wants
each edge of a PWM output is told 400,000 a second: seed 6716 looks 93,149 times."""
LINK_FAULTS: Final = ("link_dead", "link_closed")
PATIENCE_NS: Final = 20 * 10**9
"""How long the last requests may take."""


def _fault(name: str, place: int) -> dict[str, str]:
    """Return the order that breaks a link."""
    return {"do": "fault.arm", "name": name, "target": f"host{place}"}


class SimulatedFile(io.RawIOBase):
    """A file that takes what it likes of each write, and nothing more once it is full."""

    def __init__(self, system: System, size: int) -> None:
        self.content = bytearray()
        self._system = system
        self._size = size

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        data = bytes(data)[: self._size - len(self.content)]
        if not data:
            raise OSError(errno.ENOSPC, "No space left on device")
        self._system.fail("write")
        data = data[: self._system.random.choice((1 << 20, 1 << 20, 1 + len(data) // 2))]
        self.content += data
        return len(data)

    def fileno(self) -> int:
        return -1


class _Heard(logging.Handler):
    """Takes what the server logs."""

    def __init__(self) -> None:
        super().__init__()
        self.tracebacks: list[str] = []
        self.moves: Counter[str] = Counter()
        """How often each transition of a session or terminal was taken."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.name == "vbus.states" and isinstance(record.args, tuple):
            self.moves[", ".join(map(str, record.args[1:]))] += 1
        if record.exc_info or record.levelno >= logging.ERROR:
            self.tracebacks.append(logging.Formatter().format(record))


class _Observed(Server):
    """Says which session serves which connection."""

    def __init__(self, simulation: "Simulation", *args: Any, **keys: Any) -> None:
        super().__init__(*args, **keys)
        self._simulation = simulation

    def _connect(self, host: HostEntry, services: Services, link: Link) -> None:
        self._simulation.connecting(link)
        super()._connect(host, services, link)


@dataclass
class Outcome:
    """What a run comes to.

    Attributes:
        seed: of the run.
        wrong: what does not hold; "" if everything does.
        digest: of everything that happened.
        counts: how much of what.
        moves: how often each transition of sessions and terminals was taken.
    """

    seed: int
    wrong: str = ""
    digest: str = ""
    counts: dict[str, int] = field(default_factory=dict)
    moves: Counter[str] = field(default_factory=Counter)


@cache
def _board_file(text: str) -> Any:
    return read_board_text(text, "simulated.toml")


def _board(text: str) -> Board:
    board = build(*_board_file(text))
    board.text = text
    return board


class Simulation:
    """One run.

    Args:
        seed: decides everything.
        directory: for names; empty, and so at the end.
    """

    def __init__(self, seed: int, directory: Path) -> None:
        self.random = random = Random(seed)
        self.system = System(random)
        self.directory = directory
        self.policy = random.choice(POLICIES)
        text = f'[board]\nname = "simulated"\ntime = "{self.policy}"\npower_on = "done"\n'
        self.text = text + random.choice(CHIPS)
        self.board = _board(self.text)
        left = random.choice((END, END, SECOND * 3600, 50 * MS, 3 * MS, US))
        self.board.run_until(END - left)
        self.durable = random.choice(("no", "process", "machine"))
        self.file = SimulatedFile(self.system, random.choice((1 << 30, 1 << 30, 3000)))
        self.reports: list[str] = []
        self.heard = _Heard()
        self.problems: list[str] = []
        self.steps = 0
        self._began = self._now = self.board.now
        self.said_again = 0
        self.ended = False
        """Whether the board's time has ended."""
        self._serials: dict[int, Transcript] = {}
        self._ports = 0
        self._photo: tuple[bytes, dict[int, int]] = b"", {}
        self._photo_at = random.randrange(200)
        self.recording = Recording(self.board, self.text, "simulated.toml", self.reports.append)
        self.network = Network(self.system)
        self.specs, self.hosts = self._entries()
        self.loop: SimulatedLoop
        self.server: Server
        self.base: list[str] = []

    def _entries(self) -> tuple[list[LinkSpec], list[Host]]:
        """Return the hosts' entries, and who uses them."""
        specs: list[LinkSpec] = []
        hosts: list[Host] = []
        for number, kind in enumerate(self._kinds()):
            self._entry(number, kind, specs, hosts)
        return specs, hosts

    def _kinds(self) -> list[str]:
        random = self.random
        kinds = [random.choice(("pty", "unix")) for _ in range(random.choice((1, 1, 1, 2, 3)))]
        return [*kinds, "zenoh"] if random.random() < 0.3 else kinds

    def _entry(self, number: int, kind: str, specs: list[LinkSpec], hosts: list[Host]) -> None:
        random, path = self.random, self.directory / f"host{number}"
        names = [chip.name for chip in self.board.chips]
        for turn in range(1 if kind == "pty" else random.choice((1, 2))):
            name, manners = f"host{number}{'ab'[turn]}", self._manners()
            if kind == "zenoh":
                host = NetworkHost(self.system, name, path, False, self._ask, manners)
                host.network, host.board = self.network, self.board.name
                hosts.append(host)
            else:
                hosts.append(Host(self.system, name, path, kind == "pty", self._ask, manners))
        if kind == "zenoh":
            specs.append(LinkSpec("zenoh:", network=PLACE))
        else:
            chips = random.choice(([], names[:1], names[-1:]))
            specs.append(LinkSpec(f"{kind}:{path}", chips=chips))

    def _manners(self) -> dict[str, float]:
        random = self.random
        rude = random.choice((0.0, 0.02, 0.1))
        return {
            "leave": rude, "leave_and_come": rude / 2, "half": 0.2,
            "stall": random.choice((0, 0.1)), "garble": rude / 4, "half_close": rude / 4,
            "share": 0.02, "hog": rude / 4,
        }  # fmt: skip

    def _ask(self, transcript: Transcript) -> None:
        now = self.board.now
        ask_something(self.random, transcript, self.policy, END - now, now)

    # -- what is looked at ----------------------------------------------------------------------

    def connecting(self, link: Link) -> None:
        """A session begins: note whose it is."""
        file = self.system.files.get(link.fd)
        found: list[Transcript] = []
        if isinstance(link, ZenohLink):
            found = [self.network.sessions[link.session]]
        elif isinstance(file, End) and file.peer is not None:
            found = [file.peer.transcript]
        elif isinstance(file, Terminal):
            slaves = [one for one in self.system.files.values() if isinstance(one, Slave)]
            found = [one.transcript for one in slaves if one.terminal is file and one.transcript]
        for transcript in found:
            if transcript.port >= 0:
                transcript.whole = False  # a session more for the same host
            transcript.port = self._ports
        self._ports += 1

    def _take_photo(self) -> None:
        """Keep what the journal holds and what hosts have heard, as if the server were killed."""
        self._photo = (
            bytes(self.file.content),
            {id(one): len(one.said) for host in self.hosts for one in host.transcripts},
        )

    def check(self) -> None:
        """Look at everything that must hold between two steps.

        Raises:
            Wrong: something does not.
        """
        self.steps += 1
        if self.steps == self._photo_at:
            self._take_photo()
        board, server = self.board, self.server
        if self.steps > STEPS:
            raise Wrong(f"{STEPS} steps, and no end")
        if self.problems or self.heard.tracebacks:
            raise Wrong((self.problems + self.heard.tracebacks)[0])
        if board.now < self._now:
            raise Wrong(f"time went back from {self._now} to {board.now} ps")
        if board.now > END:
            raise Wrong(f"time went beyond its end, to {board.now} ps")
        self._now = board.now
        sessions = list(server.sessions())
        ports = [session.port for session in sessions]
        under_way = server.detached.under_way
        ports += [session.port for session in under_way]
        if {id(port) for port in board.ports} != {id(port) for port in ports}:
            raise Wrong(f"{len(board.ports)} ports are open, and {len(ports)} are held")
        for session in sessions:
            if session.state == DRAINING and self.random.random() < 0.2:
                session.hang_up_soon("closed by a fault")
        for chip, owner in board.hosts.claims.items():
            if owner not in ports:
                raise Wrong(f"{chip} is claimed by a session that is over")
        files = {session.link.fd for session in sessions if session.link.fd >= 0}
        if files - set(self.system.files):
            raise Wrong("the descriptor of a session is closed")
        for session in sessions:
            watched = set(session._disconnects._callbacks)
            if watched - files:
                raise Wrong("the descriptor of a session that is over is still watched")
            break
        for _, _, callback in server.pacer._wakes:
            if callback.__self__ not in [*sessions, *under_way]:  # type: ignore[attr-defined]
                raise Wrong("a session that is over is still to be woken")
        selector = self.loop._selector
        known, real = set(selector.get_map()), set(selector._selector.entries)  # type: ignore[attr-defined]
        if known != real:
            raise Wrong(f"the loop watches {known - real}, which are closed")

    # -- the run ----------------------------------------------------------------------------------

    def run(self) -> str:
        """Run from beginning to end; return a digest of what happened.

        Raises:
            Wrong: an invariant does not hold.
        """
        system = self.system
        with system.installed(), self._logged(), self._on_the_network():
            opened = mock.Mock(path="journal", begin=lambda: self.file)
            with mock.patch.object(recording, "OutputFile", return_value=opened):
                self.recording.open(RecordSection(journal="journal", durable=self.durable))
            self.loop = SimulatedLoop(system)
            self.loop.set_exception_handler(self._raised)
            stall = self.random.choice(("catch_up", "slip"))
            pacer = WallClockPacer(self.board, stall, system.clock, system.clock)
            self.server = _Observed(
                self, self.board, self.specs, report=self.reports.append, pacer=pacer,
                settle=self.recording.settle,
            )  # fmt: skip
            # On the object: compiled modules have their own reference to a module or a constant.
            turns = self.server._turns
            turns.looks, turns.give_way = system.looks, system.called
            pacer.on_end = self._time_is_over
            try:
                self._start()
                self._scenes()
            finally:
                system.step = lambda: None
                self.server.stop()
                self.loop.close()
                self.recording.close()
        self._after()
        return self._digest()

    def _start(self) -> None:
        shortage, self.system.shortage = self.system.shortage, 0.0
        self.server.start(self.loop)
        self.recording.start(self.loop)
        self.system.shortage = shortage
        self.system.step = self.check

    @contextmanager
    def _on_the_network(self) -> Iterator[None]:
        exchanged: dict[str, Any] = {
            "open_network": lambda network: self.network, "close_session": Network.close,
            "free_endpoint": lambda protocol: "tcp/127.0.0.1:1", "TOKEN_SECONDS": 0.2,
            "Publications": lambda *what: mock.Mock(),
        }  # fmt: skip
        with ExitStack() as stack:
            for name, new in exchanged.items():
                stack.enter_context(mock.patch.object(zenoh_transport, name, new))
            yield

    @contextmanager
    def _logged(self) -> Iterator[None]:
        logger, states = logging.getLogger("vbus"), logging.getLogger("vbus.states")
        propagates, logger.propagate = logger.propagate, False
        states.setLevel(logging.DEBUG)
        logger.addHandler(self.heard)
        try:
            yield
        finally:
            logger.removeHandler(self.heard)
            states.setLevel(logging.NOTSET)
            logger.propagate = propagates

    def _raised(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        self.problems.append(f"{context['message']}: {context.get('exception')!r}")

    def _time_is_over(self) -> None:
        self.ended = True
        self.loop.stop()

    def _intrude(self) -> None:
        coming = [host for host in self.hosts if not host.done]
        if coming:
            self._guarded(self.random.choice(coming).act)

    def _guarded(self, act: Callable[[], None]) -> None:
        """Keep what a host finds wrong for the next step: the server is under way."""
        try:
            act()
        except Wrong as wrong:
            self.problems.append(str(wrong))

    def _run_until(self, done: Callable[[], bool], limit_ns: int) -> bool:
        """Run the loop until something holds; tell whether it does before time is up."""
        system = self.system
        deadline = system.ns + limit_ns

        def look() -> None:
            if done() or self.ended or system.ns >= deadline:
                self.loop.stop()
                self.loop._readers.wanted = True
            else:
                system.after(2_000_000, look)

        look()
        self.loop.run_forever()
        return done()

    def _scenes(self) -> None:
        random, system = self.random, self.system
        self._run_until(lambda: True, 0)
        self.base = [kind for kind in map(self._kind, system.files.values()) if kind]
        system.intrude = self._intrude
        for host in self.hosts:
            host.begin()
        for _ in range(random.choice((0, 0, 1, 3))):
            system.after(random.randrange(60_000_000), self._stall)
        for _ in range(random.choice((0, 0, 1, 3))):
            system.after(random.randrange(60_000_000), self._order)
        self._run_until(lambda: self.ended, random.choice((5, 30, 80)) * 1_000_000)
        for host in self.hosts:
            host.done = True
        system.shortage = 0.0
        if not self.ended:
            self._everything_is_answered()
        if not self.ended:
            self._whoever_comes_is_served()
        for host in self.hosts:
            host.leave()
        if not self.ended:
            self._run_until(lambda: False, 300_000_000)
            self._nothing_is_left()

    def _order(self) -> None:
        """The board is paused, or a link is broken, for a while."""
        place, name = self.random.randrange(len(self.specs)), self.random.choice(LINK_FAULTS)
        begin, end = {"do": "pause"}, {"do": "go"}
        if self.random.random() < 0.5:
            begin, end = _fault(name, place), {"do": "fault.clear"}
        self._give(begin)
        if name == "link_dead" and begin != {"do": "pause"}:
            for host in self.hosts:
                host.lose_answers(f"host{place}")
        self.system.after(self.random.randrange(20_000_000), partial(self._give, end))

    def _give(self, order: dict[str, str]) -> None:
        answer = self.server.control.carry_out(order)
        if "done" not in answer and not order["do"].startswith("fault."):
            raise Wrong(f"{order}: {answer}")

    def _stall(self) -> None:
        """The machine does nothing for a while."""
        self.system.ns += self.random.randrange(400_000_000)

    @property
    def _full(self) -> bool:
        journal = self.recording.journal
        return self.durable != "no" and journal is not None and bool(journal.error)

    def _everything_is_answered(self) -> None:
        """Hosts that are still there hear all they have asked for."""
        for host in self.hosts:
            host.ask_last()
        if not self._run_until(self._all_gone, PATIENCE_NS) and not self.ended:
            for host in self.hosts:
                if host.connected and not host.transcript.lost and host.transcript.whole:
                    host.complain()
        for host in self.hosts:
            host.leave()
        for _ in range(2):  # the server has looked, and has looked whether there is more
            self._run_until(lambda: False, 150_000_000)

    def _all_gone(self) -> bool:
        gone = [host.go_on_to_the_end() for host in self.hosts]
        return self.ended or all(gone)

    def _whoever_comes_is_served(self) -> None:
        """A host that comes after all others gets every chip, and its answers."""
        if self._full:
            return
        for host in self.hosts:
            host.unheard = False
            host.connect()
            if not host.connected:
                raise Wrong(f"{host._name}: nobody is let in any more; {self.reports}")
            for name in ("CLAIM", "NOW", "SAMPLE", "UNCLAIM"):
                host.transcript.ask(name)
            host.ask_last()
        self._everything_is_answered()
        for host in self.hosts:
            if not host.transcript.settled and not self.ended and not self._full:
                host.complain()

    def _nothing_is_left(self) -> None:
        server, system = self.server, self.system
        if list(server.sessions()) or self.board.ports or self.board.hosts.claims:
            raise Wrong("sessions are left, and nobody is connected")
        if server.pacer._wakes:
            raise Wrong("somebody is to be woken, and nobody is connected")
        now = [self._kind(file) for file in system.files.values()]
        now = [kind for kind in now if kind]
        if len(now) != len(self.base):
            raise Wrong(f"descriptors at the start: {self.base}; now: {now}")

    @staticmethod
    def _kind(file: File) -> str:
        """A terminal may have lost its watch to a shortage; it does without."""
        return "" if isinstance(file, Inotify) else type(file).__name__

    def _after(self) -> None:
        """Look at what the server has left behind."""
        left = [type(file).__name__ for file in self.system.files.values()]
        if left:
            raise Wrong(f"these descriptors are left open: {left}")
        names = names_in(self.directory)
        if names:
            raise Wrong(f"these names are left: {names}")
        if self.problems or self.heard.tracebacks:
            raise Wrong((self.problems + self.heard.tracebacks)[0])
        self._look_into_the_journal()
        self._say_it_again()

    def _look_into_the_journal(self) -> None:
        journal = self.recording.journal
        assert journal is not None
        content, heard = self._photo
        if content and self.durable != "no":
            self._compare(self._entries_of(content), heard)
        entries = self._entries_of(bytes(self.file.content))
        if not journal.error or self.durable != "no":
            self._compare(entries, None)
        if not journal.error:
            families = {chip.name: chip.FAMILY for chip in self.board.chips}
            outcome = Replay(_board(self.text), entries, families).run()
            if outcome.divergence is not None or not outcome.ended:
                raise Wrong(f"the journal played again: {outcome.divergence}")

    def _entries_of(self, content: bytes) -> list[Any]:
        """Return what can be read of the journal."""
        journal = self.recording.journal
        assert journal is not None
        try:
            return list(JournalReader(io.BytesIO(content)))
        except JournalError:
            if not journal.error:
                raise
            return []  # not even its header has been written

    def _compare(self, entries: list[Any], heard: dict[int, int] | None) -> None:
        """Compare what hosts have heard, up to so many answers each, with a journal."""
        sessions: dict[int, list[Any]] = {}
        for entry in entries:
            sessions.setdefault(entry.port, []).append(entry)
        for host in self.hosts:
            for one in host.transcripts:
                if one.port >= 0 and one.whole:
                    most = len(one.said) if heard is None else heard.get(id(one), 0)
                    compare(one, one.said[:most], sessions.get(one.port, []), heard is None)

    def _say_it_again(self) -> None:
        """On a lockstep board that one host has at a time, only requests decide about time.

        The same bytes, given to the same board without a server, have the same answers.
        """
        if self.policy != "lockstep" or len(self.hosts) != 1:
            return
        board = _board(self.text)
        board.run_until(self._began)
        for heard in self.hosts[0].transcripts:
            if not (heard.whole and heard.polite_end and heard.port >= 0):
                return  # nobody knows how much of it was carried out
            port = board.open_port("host0", self.specs[0].chips or None)
            wire = ByteProtocol(port)
            wire.receive(bytes(heard.bytes_asked))
            while port.held:
                board.run_until(max(port.hold_until, board.now))
                if port.go_on():
                    wire.resume()
            again = Transcript(heard.name)
            again.asked, again.sent = heard.asked, heard.sent
            again.take(wire.take())
            wire.reset()
            port.close()
            sides = [[one for one in side.said if one[0] not in "IH"] for side in (heard, again)]
            if sides[0] != sides[1]:
                raise Wrong(f"{heard.name}: without a server the answers are others: {sides}")
            self.said_again += 1

    def _digest(self) -> str:
        heard = [(one.name, one.said) for host in self.hosts for one in host.transcripts]
        seen = (
            bytes(self.file.content),
            heard,
            self.system.ns,
            self.steps,
            self.board.state_hash(),
        )
        return sha256(repr(seen).encode()).hexdigest()


def simulate(seed: int) -> Outcome:
    """Make one run."""
    outcome = Outcome(seed)
    with private_runtime() as directory:
        (directory / "boards").mkdir(mode=0o700)
        simulation = None
        try:
            simulation = Simulation(seed, directory)
            outcome.digest = simulation.run()
        except Wrong as wrong:
            outcome.wrong = str(wrong)
        except Exception:
            outcome.wrong = traceback.format_exc()
        if simulation is not None:
            outcome.moves = simulation.heard.moves
            said = [one for host in simulation.hosts for one in host.transcripts]
            outcome.counts = {
                "steps": simulation.steps, "connections": len(said),
                "answers": sum(len(one.said) for one in said),
                "compared": sum(one.whole and one.port >= 0 for one in said),
                "repeated": simulation.said_again,
            }  # fmt: skip
    return outcome
