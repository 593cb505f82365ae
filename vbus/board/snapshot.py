"""Snapshots: a whole board at one instant, as a value and as a file.

A snapshot holds what decides all that follows: time, chips with their plants, wires, hosts with
half-sent requests, and the streams jitter draws from. Its size does not depend on how long the
board has run. It is loaded into a board built from the same file.
"""

import hashlib
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import msgpack
import msgspec
from msgspec import Struct

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.board.loading import prepare
from vbus.core.errors import SnapshotError
from vbus.core.file_kinds import HEAD, is_none
from vbus.core.kernel import END, MS, NEVER
from vbus.core.state import save, validate
from vbus.core.state.kinds import Load
from vbus.protocols.base import Protocol
from vbus.version import __version__

VERSION: Final = 1
"""Version of the file format."""


def seal(magic: bytes, *content: Any) -> bytes:
    """Return a file: what it begins with, a checksum, and its version and the rest in msgpack."""
    body: bytes = msgpack.packb(content)
    return magic + hashlib.sha256(body).digest() + body


def unseal(magic: bytes, data: bytes, name: str, kind: str, shape: Any) -> Any:
    """Return what :func:`seal` was given behind the version.

    Args:
        magic: what the file begins with.
        data: the bytes.
        name: what to call it in an error.
        kind: what it should be.
        shape: the type that the values have together.

    Raises:
        SnapshotError: it is none, was cut short or damaged, or is of a later version.
    """
    if not data.startswith(magic):
        made = '"vbus snap save" takes one of a running board'
        raise SnapshotError(is_none(name, data[:HEAD], kind, made))
    start = len(magic) + 32
    body = data[start:]
    if hashlib.sha256(body).digest() != data[len(magic) : start]:
        raise SnapshotError(f"{name}: cut short or damaged: its checksum does not fit")
    try:
        version, *content = msgpack.unpackb(body, use_list=False, strict_map_key=False)
        if version == VERSION:
            return msgspec.convert(content, shape, builtin_types=(bytes,))
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise SnapshotError(f"{name}: its content makes no sense: {error}") from error
    raise SnapshotError(f"{name}: format {version}; this vbus reads format {VERSION}")


MAGIC: Final = b"vbus snapshot\n"

TRIED: Final = 2 * MS
"""Chip time that a snapshot from elsewhere is tried for on a twin."""

Hosts = dict[int, Protocol]
"""Wire formats of sessions, by the place of their port in ``board.ports``."""


_Count = Annotated[int, msgspec.Meta(ge=0, le=NEVER)]


class HostState(Struct, frozen=True, array_like=True):
    """A host's session at the time of a snapshot.

    Attributes:
        label: its name in traces.
        chips: what it may select.
        cycle_ps: what it says a whole bus cycle costs; 0 is the default.
        leased_until: instant until which a lease given to it holds (ps).
        wire: what its wire format keeps: half a request, counts, promises.
    """

    label: str
    chips: tuple[str, ...]
    cycle_ps: _Count
    leased_until: Annotated[int, msgspec.Meta(ge=-1, le=NEVER)]
    wire: Any


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A board at one instant.

    Attributes:
        when: the instant (ps).
        board: name of the board.
        file: name of its board file, or "".
        text: the board file; "" for a board put together in Python.
        vbus: version that made it.
        parts: part numbers by name of chip.
        hosts: sessions, in the order of ``Board.ports``.
        state: what :meth:`Board.save` gives, and of a node what leads beyond the board.
        counters: the board's totals.
        digest: SHA-256 (hex) over the state.
        taken: whether :func:`take` made it; what comes from elsewhere is tried on a twin first.
    """

    when: int
    board: str
    file: str
    text: str
    vbus: str
    parts: dict[str, str]
    hosts: tuple[HostState, ...]
    state: Any
    counters: dict[str, int] = field(default_factory=dict)
    digest: str = ""
    taken: bool = field(default=False, compare=False, repr=False)


def take(board: Board, wires: Hosts | None = None) -> Snapshot:
    """Return a snapshot of ``board`` as it stands.

    Args:
        board: the board; between two calls of its hosts.
        wires: wire formats of its sessions, to keep half-sent requests too.

    Raises:
        SnapshotError: a chip or a plant, maybe a plug-in's, gives no state that can be saved.
    """
    wires = wires or {}
    for axis, plant in board.axes.items():
        if why := plant.unsaved():
            raise SnapshotError(f"axis {axis}: {why}")
    state = board.save()
    if board.beyond is not None:
        state["beyond"] = board.beyond.save()
    hosts = tuple(
        HostState(
            port.label,
            tuple(chip.name for chip in port.chips),
            port.cycle_ps,
            port.polls.until,
            save(wires[number]) if number in wires else None,
        )
        for number, port in enumerate(board.ports)
    )
    try:
        digest = _digest(state)
    except (TypeError, ValueError, OverflowError) as error:
        raise SnapshotError(_culprit(board, error)) from error
    return Snapshot(
        board.now, board.name, board.file, board.text, __version__,
        {chip.name: chip.part for chip in board.chips}, hosts, state, dict(board.counters), digest,
        taken=True,
    )  # fmt: skip


def _digest(state: Any) -> str:
    return hashlib.sha256(msgpack.packb(state)).hexdigest()


def _culprit(board: Board, error: Exception) -> str:
    """Say which chip's state is not made of numbers, strings, bytes and tuples of them."""
    for chip in board.chips:
        try:
            msgpack.packb(save(chip))
        except (TypeError, ValueError, OverflowError) as found:
            return (
                f"chip {chip.name} ({type(chip).__name__}) or a plant of it has a field that no"
                f" snapshot can hold: {found}; the kinds a field of STATE can have are those of"
                " vbus.core.state"
            )
    return f"the board's state cannot be saved: {error}"


def restore(board: Board, snapshot: Snapshot, wires: Hosts | None = None) -> None:
    """Bring ``board`` to where ``snapshot`` was taken.

    Sessions that are open stay open. One with the label and the chips of a session of the
    snapshot takes over its state; what other sessions of the snapshot held (pins, claims) is let
    go, as if they had just ended; other open sessions go on with nothing held.

    A snapshot from elsewhere is loaded into a twin of the board first: what does not hold
    together never reaches the board.

    Args:
        board: a board built from the same file.
        snapshot: made by :func:`take` or :func:`read`.
        wires: wire formats of the open sessions.

    Raises:
        SnapshotError: it belongs to another board, or was made by another version; the board is
            as it was.
    """
    _check(board, snapshot)
    if not snapshot.taken and board.beyond is None:  # a node does nothing without the others
        _try(snapshot)
    _bring(board, snapshot, wires or {})


def _try(snapshot: Snapshot) -> None:
    """Load a snapshot into a board of its own, and let that run a little.

    Raises:
        SnapshotError: it cannot be loaded, does not run, or belongs to another instant.
    """
    if not snapshot.text:
        return  # there is no board file to build another from
    twin = rebuild(snapshot)
    try:
        for host in snapshot.hosts:
            twin.open_port(host.label, host.chips, host.cycle_ps)
        _bring(twin, snapshot, {})
        begun = twin.now
        for chip in twin.chips:
            if chip.overdue():
                raise SnapshotError(f"chip {chip.name}: its state is not of {begun} ps")
        twin.catch_up()
        twin.run_until(min(begun + TRIED, END))
        twin.catch_up()
    except SnapshotError:
        raise
    except Exception as error:
        raise SnapshotError(f"the state does not hold together: {error!r}") from error
    if begun != snapshot.when:
        raise SnapshotError(f"the state is of {begun} ps, the snapshot of {snapshot.when} ps")


def _bring(board: Board, snapshot: Snapshot, wires: Hosts) -> None:
    mine = list(board.ports)
    order: list[HostBus] = []
    guests: list[HostBus] = []
    for host in snapshot.hosts:
        port = next((port for port in mine if _same(port, host)), None)
        if port is None:
            port = board.open_port(host.label, host.chips, host.cycle_ps)
            guests.append(port)
        else:
            mine.remove(port)
        order.append(port)
    attached = list(board.ports)
    # Ports are saved by their place: meanwhile those of the snapshot alone are there.
    board.ports[:] = order
    try:
        halves = [
            _half(wire, snapshot.hosts[order.index(attached[number])].wire)
            for number, wire in wires.items()
            if attached[number] in order
        ]
        state, beside = snapshot.state, None
        if board.beyond is not None and isinstance(state, dict):
            state = {**state}
            beside = board.beyond.prepare(state.pop("beyond", None))
        loading = prepare(board, state)
        for port in mine:
            port.let_go()
        loading()
        if beside is not None:
            beside.apply()
    finally:
        board.ports[:] = attached
        for port in guests:
            port.close()
    for port in mine:
        port.forget_time()
    for port, host in zip(order, snapshot.hosts, strict=True):
        port.polls.until = host.leased_until
    for half in halves:
        half.apply()
    board.set_counters(snapshot.counters)
    # They were found in the run that is left.
    board.violations.clear()


def _half(wire: Protocol, saved: Any) -> Load:
    """Check half a request against the wire format it is for."""
    return validate(wire, saved, type(wire).__name__)


def _same(port: HostBus, host: HostState) -> bool:
    return port.label == host.label and tuple(c.name for c in port.chips) == host.chips


def _check(board: Board, snapshot: Snapshot) -> None:
    parts = {chip.name: chip.part for chip in board.chips}
    if parts != snapshot.parts:
        raise SnapshotError(
            f'the snapshot is of board "{snapshot.board}" with {_listed(snapshot.parts)}; this is'
            f' board "{board.name}" with {_listed(parts)}'
        )
    if snapshot.text != board.text:
        raise SnapshotError(
            f'the snapshot was taken on another version of the board file of "{board.name}"; run'
            " that one (vbus snap info --board-file shows it), or take the snapshot again"
        )


def _listed(parts: dict[str, str]) -> str:
    return ", ".join(f"{name} = {part}" for name, part in parts.items()) or "no chips"


def fork(board: Board, wires: Hosts | None = None) -> Board:
    """Return a second board that stands where ``board`` stands, with the same hosts attached.

    What is done to one is not done to the other. Observers stay with the first.

    Raises:
        SnapshotError: ``board`` was put together in Python, so there is no file to build
            another from; build one the same way and :func:`restore` a snapshot on it.
    """
    snapshot = take(board, wires)
    twin = rebuild(snapshot)
    for host in snapshot.hosts:
        twin.open_port(host.label, host.chips, host.cycle_ps)
    restore(twin, snapshot)
    twin.violations.extend(board.violations)
    return twin


def rebuild(snapshot: Snapshot) -> Board:
    """Return a board built from the file a snapshot holds, at instant 0.

    Raises:
        SnapshotError: it holds none.
    """
    if not snapshot.text:
        raise SnapshotError(
            f'board "{snapshot.board}" was put together in Python, not from a board file: build'
            " another one the same way, and restore() a snapshot on it"
        )
    return load_board_text(snapshot.text, snapshot.file or "board.toml")


# -- as a file ----------------------------------------------------------------------------------

_Content = tuple[
    _Count, str, str, str, str, dict[str, str], tuple[HostState, ...], Any, dict[str, int], str
]  # fmt: skip


def write(snapshot: Snapshot) -> bytes:
    """Return a snapshot as the content of a file."""
    s, hosts = snapshot, [msgspec.structs.astuple(host) for host in snapshot.hosts]
    return seal(
        MAGIC, VERSION, s.when, s.board, s.file, s.text, s.vbus, s.parts, hosts, s.state,
        s.counters, s.digest,
    )  # fmt: skip


def read(data: bytes, name: str = "the snapshot") -> Snapshot:
    """Return the snapshot in a file's content.

    Args:
        data: the bytes.
        name: what to call it in an error.

    Raises:
        SnapshotError: it is none, was cut short or damaged, or is of a later version.
    """
    found = Snapshot(*unseal(MAGIC, data, name, "snapshot of vbus", _Content))
    try:
        if _digest(found.state) != found.digest:
            raise ValueError("the state has not the hash that stands beside it")
    except (ValueError, TypeError, RecursionError) as error:
        raise SnapshotError(f"{name}: its content makes no sense: {error}") from error
    return found
