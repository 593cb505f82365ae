"""A page of the documentation as people use it: blocks are pasted, and what they print is compared.

Each block is typed in a shell of its own, all of a page in one folder.

=====================  =========================================================================
after "save this as"   the block is the named file
``sh``                 commands
``console``            lines after ``$`` are commands, up to one that does not end in ``\\``; the
                       lines after a command are what it prints
``output``             what the ``sh`` block before has printed, standard error too
any other language     is read and not typed; a block without a language is refused
=====================  =========================================================================

In printed lines ``...`` stands for anything, and alone on a line for any lines, none included.
``console`` ends in ``^C`` where a command serves: then each command begins when the one before has
ended or has printed what the page shows, and at ``^C`` what still runs is interrupted, and ends
with 0 if it is vbus. A scope that stays for who looks at a run is ended by the process it has
printed.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

from tests.examples.boards import as_installed
from tests.waiting import Starved, until

ROOT: Final = Path(__file__).parents[2]
FENCE: Final = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVE_AS: Final = re.compile(r"[Ss]ave this\s+as\s+`([\w./-]+)`")
MINUTES: Final = re.compile(
    r"release\.py wheel|install\.sh|venv .*pip install|pip install .*--target build/compiled"
)
"""What compiles vbus or installs all it needs."""
PATIENCE: Final = 300.0
LEAVING: Final = 60.0
"""Seconds that a page's processes may take to end."""
LONG: Final = 1800.0
"""Seconds for what :data:`MINUTES` finds."""


@dataclass(frozen=True)
class Command:
    """What is typed, and what the page shows of it; None: nothing, so that anything may come."""

    text: str
    shown: str | None = None


@dataclass(frozen=True)
class Block:
    """Commands that are pasted into one shell, or of a console each into its own.

    Attributes:
        line: where it stands on the page.
        commands: in order.
        interrupted: whether ``^C`` ends what still runs.
    """

    line: int
    commands: tuple[Command, ...]
    interrupted: bool = False

    @property
    def text(self) -> str:
        """All that is typed."""
        return "".join(command.text for command in self.commands)


def blocks_of(page: str) -> list[Block]:
    """Return what a page has typed.

    Raises:
        ValueError: a block says not what it is.
    """
    blocks: list[Block] = []
    end = 0
    for fence in FENCE.finditer(page):
        language, text = fence.groups()
        line = page.count("\n", 0, fence.start()) + 1
        named = SAVE_AS.findall(page[end : fence.start()])
        end = fence.end()
        if named:
            text = f"cat > {named[-1]} <<'END_OF_FILE'\n{text}END_OF_FILE\n"
            blocks.append(Block(line, (Command(text),)))
        elif language == "sh":
            blocks.append(Block(line, (Command(text),)))
        elif language == "console":
            blocks.append(_console(line, text))
        elif language == "output":
            [typed] = blocks[-1].commands
            blocks[-1] = Block(blocks[-1].line, (Command(typed.text, text),))
        elif not language:
            raise ValueError(f"line {line}: a block without a language; what is read alone is text")
    return blocks


def _console(line: int, text: str) -> Block:
    interrupted = text.endswith("^C\n")
    commands = [
        Command(command, shown)
        for command, shown in re.findall(
            r"^\$ ((?:.*\\\n)*.*\n)((?:(?!\$ ).*\n)*)", text.removesuffix("^C\n"), re.MULTILINE
        )
    ]
    return Block(line, tuple(commands), interrupted)


def pattern(shown: str) -> re.Pattern[str]:
    """Return what printed lines have to match."""
    lines = [
        r"(?:.*\n)*?" if line == "..." else re.escape(line).replace(r"\.\.\.", ".*") + r"[ ]*\n"
        for line in shown.splitlines()
    ]
    return re.compile("".join(lines))


def _docker() -> str:
    done = subprocess.run(["docker", "version"], capture_output=True, timeout=PATIENCE)
    return "no Docker engine answers" if done.returncode else ""


def _display() -> str:
    return "" if os.environ.get("DISPLAY") else "no display"


MADE: Final = "what it needs was to be made by those"
PROGRAMS: Final[dict[str, Callable[[], str]]] = {
    "docker": _docker, "pulseview": _display, "chromium": str, "sigrok-cli": str, "gdb": str,
    "avr-gcc": str, "gcc": str, "picocom": str, "npm": str, "arm-none-eabi-gcc": str,
    "m68k-linux-gnu-gcc": str, "nasm": str,
}  # fmt: skip
"""What vbus does not bring along: what else this machine may lack for it."""
NO_PACKAGE: Final = ("no Docker engine answers", "no docker on this machine", "no display",
                     "no pulseview on this machine", MADE)  # fmt: skip
"""What no package brings to a machine that has all a test can want."""


def lacking(block: Block) -> str:
    """Return what this machine lacks for a block; nothing if it can be typed here."""
    text = block.text
    for program, more in PROGRAMS.items():
        if re.search(rf"(?<![\w/.-]){program}(?![\w/.-])", text):
            lacks = more() if shutil.which(program) else f"no {program} on this machine"
            if lacks:
                return lacks
    if MINUTES.search(text) and os.environ.get("VBUS_REQUIRE_ALL") != "1":
        return "it compiles or installs for minutes, which VBUS_REQUIRE_ALL=1 asks for"
    return ""


def ports_in_use(blocks: Iterable[Block]) -> str:
    """Return which port of a page another program has; nothing if all are free."""
    text = "".join(command.text for block in blocks for command in block.commands)
    for address in sorted({*re.findall(r"127\.0\.0\.1[:/](\d+)|rfc2217:(\d+)", text)}):
        port = "".join(address)
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", int(port)))
            except OSError as error:
                return f"port {port} of this machine cannot be had: {error.strerror}"
    return ""


@dataclass(frozen=True)
class _Typed:
    """A command that was typed: its process, and the file of what it prints."""

    command: Command
    process: subprocess.Popen[bytes]
    place: Path

    def printed(self) -> str:
        """Return what has come; of a line that was written over, the last."""
        text = self.place.read_bytes().decode(errors="replace").replace("\r\n", "\n")
        return re.sub(r".*\r", "", text) + "\n" * (text[-1:] not in ("", "\n"))


class Typist:
    """Types the blocks of a page.

    Args:
        folder: where; runtime directories lie there too.
        variables: of the shells, beside those of this process.

    Attributes:
        printed: all that was printed.
        left_out: blocks that this machine cannot run, with the reason.
    """

    def __init__(self, folder: Path, **variables: str) -> None:
        self.printed: str = ""
        self.left_out: list[str] = []
        self._folder: Path = folder
        self._mark: str = f"XDG_RUNTIME_DIR={folder}"
        self._environment: dict[str, str] = {
            **as_installed(),
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "XDG_RUNTIME_DIR": str(folder),
            **variables,
        }
        self._environment.pop("VBUS_RUNTIME", None)
        self._number: int = 0
        self._started: list[subprocess.Popen[bytes]] = []

    def type(self, page: str, elsewhere: bool = False) -> None:
        """Type a page.

        Args:
            page: its text.
            elsewhere: whether something else types what takes minutes: that is passed over here,
                with what uses what it makes.

        Raises:
            AssertionError: a command fails, prints something else, or leaves something running.
            Starved: something has not come in time.
        """
        blocks = blocks_of(page)
        if taken := ports_in_use(blocks):
            self.left_out.append(taken)
            return
        try:
            for block in blocks:
                if elsewhere and (MINUTES.search(block.text) or self._gone(block)):
                    continue
                lacks = lacking(block)
                if self.left_out and not lacks and self._gone(block):
                    lacks = MADE
                if lacks:
                    self.left_out.append(f"line {block.line}: {lacks}")
                else:
                    self._block(block)
            until(lambda: not self._running(), lambda: f"the end of {self._running()}", LEAVING)
        finally:
            for process in self._running():
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            for started in self._started:
                started.wait()

    def _gone(self, block: Block) -> bool:
        """Tell whether a block uses what only one that was left out would have made."""
        return any(
            made in block.text and not (self._folder / made).exists()
            for made in (".venv", "build/compiled")
        )

    def _running(self) -> dict[int, str]:
        """Return the processes that this page has started and that run, with what each is."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if self._mark.encode() in (entry / "environ").read_bytes().split(b"\0"):
                    words = (entry / "cmdline").read_bytes().split(b"\0")
                    found[int(entry.name)] = b" ".join(words).decode().strip()
        return found

    def _block(self, block: Block) -> None:
        serving = []
        for command in block.commands:
            typed = self._start(command)
            self._wait(typed, block.interrupted)
            if typed.process.poll() is None:
                serving.append(typed)
            else:
                self._ended(block, typed)
        for typed in reversed(serving):
            if typed.process.poll() is None:
                os.killpg(typed.process.pid, signal.SIGINT)
            self._wait(typed)
            self._ended(block, typed)
        for process in re.findall(r"^scope: http.* \(process (\d+)\)$", self.printed, re.MULTILINE):
            with suppress(ProcessLookupError):  # it stays for who looks at the run
                os.kill(int(process), signal.SIGTERM)

    def _start(self, command: Command) -> "_Typed":
        self._number += 1
        place = self._folder / f".printed-{self._number}"
        with place.open("wb") as file:
            process = subprocess.Popen(
                ["bash", "-e", "-c", command.text], cwd=self._folder, env=self._environment,
                stdin=subprocess.DEVNULL, stdout=file, stderr=file, process_group=0,
            )  # fmt: skip
        self._started.append(process)
        return _Typed(command, process, place)

    def _wait(self, typed: "_Typed", serves: bool = False) -> None:
        """Wait for the end of a command, or if it ``serves`` for what the page shows of it."""
        shown = pattern(typed.command.shown or "...\n")

        def done() -> bool:
            if typed.process.poll() is not None:
                return True
            return serves and shown.match(typed.printed()) is not None

        until(
            done,
            lambda: f"{typed.command.text}which has printed:\n{typed.printed()}",
            LONG if MINUTES.search(typed.command.text) else PATIENCE,
        )

    def _ended(self, block: Block, typed: "_Typed") -> None:
        command, code, printed = typed.command, typed.process.returncode, typed.printed()
        self.printed += printed
        if late := re.search(r"^vbus: \w+ has not ended within .*", printed, re.MULTILINE):
            raise Starved("\n".join([late[0], *(log.read_text() for log in self._logs())]))
        where = f"line {block.line}: {command.text}"
        # Programs of others may die of the interrupt.
        right = (0,) if command.text.startswith("vbus") else (0, -signal.SIGINT)
        assert code in (right if block.interrupted else (0,)), (
            f"{where}ended with {code}:\n{printed}"
        )
        if command.shown is not None:
            shown = pattern(command.shown)
            same = shown.match(printed) if block.interrupted else shown.fullmatch(printed)
            assert same, f"{where}printed\n{printed}\nand the page shows\n{command.shown}"

    def _logs(self) -> Iterator[Path]:
        return self._folder.rglob("*.log")


def say_what_is_left_out(typist: Typist) -> None:
    """Skip, though the rest was typed, if this machine could not run all of a page.

    Where nothing may be left out, an engine of Docker and a display still may.
    """
    left = typist.left_out
    if os.environ.get("VBUS_REQUIRE_ALL") == "1":
        left = [one for one in left if not one.endswith(NO_PACKAGE)]
    if left:
        pytest.skip("; ".join(left))
