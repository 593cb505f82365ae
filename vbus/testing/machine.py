"""A machine of nodes in a test: all nodes in one process, its hosts in the test's own turn."""

from contextlib import ExitStack
from typing import Final

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.chips.base import Chip
from vbus.client.bus import Bus
from vbus.core.errors import ConfigError, VbusError, value_errors
from vbus.core.kernel import END
from vbus.nodes.conductor import Conductor
from vbus.nodes.machine import Machine
from vbus.nodes.node import Node
from vbus.protocols.quantities import format_instant
from vbus.serve.in_process import HostTurn, connect_in_process
from vbus.testing.checks.around_chip import ChipBench, out_of_reset
from vbus.testing.clock import coming, span_of
from vbus.testing.limits import Limits
from vbus.testing.tested_board import TestedBoard


class TestedMachine:
    """The nodes of a machine, each with a board, and one virtual time for all of them.

    The test is one program: what it does on one node comes after what it did on another. Time
    passes on all nodes as far as a host of the test, or :meth:`advance`, lets it.

    Args:
        file: the board file as it runs here.
        source: the same as text.
        strict: whether a breach of a datasheet fails the test.
        budget: what the hosts of each node may take.
        covered: whether what they exercise is counted.

    Attributes:
        now: chip time (ps).
        tested: what observes each node, in the order of the file.

    Raises:
        ConfigError: the board has no nodes, or is in real time.
    """

    __test__ = False

    def __init__(
        self, file: BoardFile, source: Source, strict: bool, budget: Limits, covered: bool = False
    ) -> None:
        if not file.nodes:
            raise ConfigError(
                f'{file.path}: this board has no nodes: take the fixture "vbus_board"'
            )
        if file.board.time == "realtime":
            raise ConfigError(
                f"{file.path}: nodes in real time follow the wall clock in processes of their own;"
                " a test has them in virtual time: leave rate out"
            )
        self.now: int = 0
        self.tested: list[TestedBoard] = []

        def watch(node: Node) -> None:
            board = node.board
            tested = TestedBoard(board, file, source, strict, budget, covered, self.run_until)
            self.tested.append(tested)

        self._machine: Final = Machine(file, source, built=watch)
        self._hosts: Final = ExitStack()

    # -- looking ------------------------------------------------------------------------------

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes, in the order of the file."""
        return self._machine.plan.nodes

    def board(self, node: str) -> Board:
        """Return the board of a node, as it is now.

        Raises:
            VbusError: there is no such node.
        """
        if node not in self.nodes:
            raise VbusError(f'the machine has no node "{node}"; it has {", ".join(self.nodes)}')
        return self._machine.conductors[self.nodes.index(node)].node.board

    def chip(self, name: str) -> ChipBench:
        """Return a chip out of its reset, with a host of its own, and with what it moves.

        Raises:
            VbusError: there is no such chip.
        """
        conductor, chip = self._find(name)
        node = conductor.node
        tested = self.tested[node.rank]
        self.run_until(max(self.now, out_of_reset(chip, tested.file)))
        return ChipBench.of(node.board, chip, self.connect(name), tested.clock, node.name)

    def connect(self, *chips: str, label: str = "host") -> Bus:
        """Return a client's bus at the node of these chips, as :func:`vbus.connect` returns it.

        Raises:
            VbusError: there is no such chip, or they are on several nodes.
        """
        found = [self._find(name)[0] for name in chips]
        if not found:
            raise VbusError("connect: to which chips? name at least one")
        if any(conductor is not found[0] for conductor in found):
            raise VbusError(f"a host is at one node, and {', '.join(chips)} are on several")
        turn = _MachineTurn(self, found[0])
        bus = connect_in_process(found[0].node.board, label, chips, turn)
        self._hosts.callback(bus.close)
        return bus

    def trace(self) -> None:
        """Note what happens on all nodes from now on: before anything has happened.

        Raises:
            VbusError: something has happened.
        """
        if self.now:
            raise VbusError(f"trace: it is {format_instant(self.now)} already; ask for it first")
        for node in self._machine.nodes:
            node.start_trace()

    def trace_hash(self) -> str:
        """Return the SHA-256 (hex) over what has happened on all nodes, as ``vbus trace`` has it.

        Raises:
            VbusError: :meth:`trace` was not called.
        """
        with value_errors(VbusError):
            return self._machine.trace_hash()

    def _find(self, name: str) -> tuple[Conductor, Chip]:
        for conductor in self._machine.conductors:
            for chip in conductor.node.board.chips:
                if chip.name == name:
                    return conductor, chip
        have = (c.name for node in self._machine.nodes for c in node.board.chips)
        raise VbusError(f'the machine has no chip "{name}"; it has {", ".join(have)}')

    # -- time ---------------------------------------------------------------------------------

    def advance(self, duration: int | str) -> None:
        """Let ``duration`` (ps, or a text with a unit) pass on all nodes.

        Raises:
            VbusError: it is negative.
        """
        self.run_until(self.now + span_of(duration))

    def run_until(self, instant: int | str) -> None:
        """Let time pass to ``instant`` on all nodes, inclusive of what happens at it.

        Raises:
            VbusError: that instant is over, or beyond the end of time.
        """
        when = coming(instant, self.now)
        if when > END:
            raise VbusError(f"run_until {format_instant(when)}: time ends at {END} ps")
        with ExitStack() as excused:
            for tested in self.tested:
                excused.enter_context(tested.watch.excused())
            self.bring(when)

    def bring(self, when: int) -> None:
        """Bring all nodes, and all that can be looked at there, to ``when`` (ps), no further."""
        self.now = max(self.now, when)
        conductors = self._machine.conductors
        for conductor in conductors:
            if conductor.node.board.now < self.now:
                for one in conductors:
                    one.until = max(one.until, self.now)
                while conductor.participant.granted <= self.now:
                    self.step(conductor)
                conductor.node.run_before(self.now + 1)
        for conductor in conductors:
            conductor.node.board.catch_up()

    def step(self, conductor: Conductor) -> None:
        """Do one thing that brings the next grant of a node nearer.

        Raises:
            VbusError: another wait holds its time.
        """
        seen = set()
        while not self._machine.poll(conductor):
            # A node that has not ended the round is behind, or waits for one further behind.
            seen.add(conductor)
            missing = conductor.participant.missing()
            others = [self._machine.conductors[rank] for rank in missing]
            behind = [other for other in others if other not in seen]
            if not behind:
                raise VbusError(
                    f"node {conductor.node.name} {conductor.state}: a port that was opened on its"
                    " board holds its time; take a host from connect() in its place"
                )
            conductor = behind[0]

    def close(self) -> None:
        """End the hosts."""
        self._hosts.close()


class _MachineTurn(HostTurn):
    """A host of a machine acts: after all that was done before, and for as long as it takes."""

    def __init__(self, machine: TestedMachine, conductor: Conductor) -> None:
        super().__init__(conductor.node.board)
        self._machine: Final = machine
        self._conductor: Final = conductor

    def let_pass(self, port: HostBus) -> None:
        """Let all nodes do what the next grant needs."""
        self._machine.step(self._conductor)

    def end(self, port: HostBus) -> None:
        """The test goes on from here, maybe elsewhere: time waits no longer for this host."""
        port.clock.used = False
        self._machine.bring(self.board.now)
