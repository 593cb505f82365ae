"""``vbus demo``: a board in this process, a host in another, a terminal line between them."""

import asyncio
import json
import os
import sys
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.look.scope_page import PageRequest, scope_options
from vbus.cli.output import complain, show
from vbus.client.demo import Demo, demo_of, demos
from vbus.core import exit_codes

if TYPE_CHECKING:
    from vbus.board.board import Board

NAMES: Final = demos()
# Several times what the longest demonstration takes in real time.
LONGEST = 60.0
"""Seconds after which a host that has not finished is given up."""
# Ten pictures a second: numbers can still be read.
REFRESH = 0.1
"""Seconds between two pictures of the live view."""


def _known(ctx: click.Context, param: click.Parameter, value: str) -> str:
    if value not in NAMES:
        from vbus.core.values.settings import among

        raise click.BadParameter(f'there is no demo "{value}"; {among(value, NAMES, "there are")}')
    return value


@click.command("demo")
@click.argument("name", metavar=f"[{'|'.join(NAMES)}]", default=NAMES[0], callback=_known)
@scope_options
@click.option("--headless", is_flag=True, help="No live view: print the summary only.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON; headless.")
def command(name: str, page: PageRequest, headless: bool, as_json: bool) -> int:
    """Watch a chip move a motor under a host in another process.

    Starts a board in this process, opens a real pseudo terminal, and lets a host in a separate
    process make moves through it in real time. The exit code is 1 if a move did not end where it
    should.
    """
    live = not headless and not as_json and sys.stdout.isatty()
    run = _DemoRun(name, live, page)
    asyncio.run(run.play())
    show(as_json, run.summary(), run.lines())
    for reason in run.reasons:
        complain(f"demo {name}: {reason}")
    return exit_codes.FAILURE if run.reasons else exit_codes.OK


class _DemoRun:
    """One demonstration from start to summary."""

    def __init__(self, name: str, live: bool, page: PageRequest) -> None:
        from vbus.board.build import load_board_text
        from vbus.boardfile.sections import ScopeSection
        from vbus.circuit.stream import LatestLines, PacketTaker
        from vbus.cli.run.demo_view import LINES
        from vbus.serve.server import LinkSpec, Server

        self.demo: Demo = demo_of(name)
        self.name: str = name
        self.reasons: list[str] = []
        """Why it has failed; empty if it has not."""
        self._live: bool = live
        self._page: PageRequest = page
        self._scope: ScopeSection = page.of(ScopeSection())
        # Two demonstrations may run at once.
        board = f"demo-{name}-{os.getpid()}"
        self._board: Board = load_board_text(f'board.name = "{board}"\n{self.demo.board}', name)
        self._packets: LatestLines = LatestLines(maxlen=LINES)
        self._board.observe(PacketTaker(lambda _, one: self._packets.add(one.end, one.text)))
        self._server: Server = Server(self._board, [LinkSpec(f"pty:$VBUS_RUNTIME/{board}")])
        self._link: str = ""
        self._host: int = 0
        self._steps: list[str] = []
        self._results: list[dict[str, Any]] = []
        self._ended: bool = False

    # -- playing ------------------------------------------------------------------------------

    async def play(self) -> None:
        """Serve the board, run the host, watch, and judge what has come of it."""
        self._server.start(asyncio.get_running_loop())
        self._link = self._server.urls[0]
        try:
            await self._page.show(self._server.board.name, self._scope)
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "vbus.client.demo", self.name, self._link,
                stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
                start_new_session=True,
            )  # fmt: skip
            self._host = process.pid
            try:
                # A page may hold time for as long as a person looks.
                longest = None if self._page.control else LONGEST  # it may be paused
                await asyncio.wait_for(self._follow(process), longest)
            except TimeoutError:
                self.reasons.append(f"the host has not finished within {LONGEST:g} s")
            finally:
                if process.returncode is None:
                    process.kill()
                    await process.wait()
        finally:
            self._server.stop()
        self._check(process.returncode or 0)

    async def _follow(self, process: asyncio.subprocess.Process) -> None:
        """Take the host's reports and keep the view up to date until it ends."""
        assert process.stdout is not None
        view = asyncio.create_task(self._watch()) if self._live else None
        try:
            async for line in process.stdout:
                self._take(json.loads(line))
            await process.wait()
        finally:
            if view is not None:
                view.cancel()
                await asyncio.gather(view, return_exceptions=True)

    async def _watch(self) -> None:
        from rich.live import Live

        from vbus.cli.run.demo_view import screen

        with Live(auto_refresh=False, transient=True) as live:
            while True:
                view = screen(self.demo, self._board, self._packets, self._link, self._steps)
                live.update(view, refresh=True)
                await asyncio.sleep(REFRESH)

    def _take(self, report: dict[str, Any]) -> None:
        if "step" in report:
            self._steps.append(report["step"])
        elif "done" in report:
            report["ok"] = abs(report["found"] - report["expected"]) <= report["tolerance"]
            self._results.append(report)
            self._steps.append(_result(report))
        elif "failed" in report:
            self.reasons.append(f"the host gave up: {report['failed']}")
        elif "end" in report:
            self._ended = True

    # -- judging ------------------------------------------------------------------------------

    def _check(self, code: int) -> None:
        if not self._ended and not self.reasons:
            self.reasons.append(f"the host ended with exit code {code} before its last step")
        for result in self._results:
            if not result["ok"]:
                self.reasons.append(f"{result['done']}: {_result(result).strip()}")
        for violation in self._board.violations:
            if violation.severity == "error":
                self.reasons.append(f"the host broke {violation.rule}: {violation.detail}")
        for number, (plant, rest) in enumerate(
            zip(self._board.plants, self.demo.rest, strict=True), 1
        ):
            # The motor is asked beside the chip: a chip that is wrong would say what the host
            # expects.
            if self._ended and abs(int(plant.count) - rest) > self.demo.tolerance:
                self.reasons.append(
                    f"the encoder of motor {number} stands at {plant.count}, not at {rest}"
                )

    def summary(self) -> dict[str, Any]:
        """Return what has happened, as data."""
        pacer = self._server.pacer
        return {
            "demo": self.name,
            "ok": not self.reasons,
            "reasons": self.reasons,
            "chips": {chip.name: chip.part for chip in self._board.chips},
            "link": self._link,
            "board_process": os.getpid(),
            "host_process": self._host,
            "results": self._results,
            "encoders": [plant.count for plant in self._board.plants],
            "bus_cycles": self._board.reads + self._board.writes,
            "violations": self._board.counters["violations"],
            "rules_broken": sorted({found.rule for found in self._board.violations}),
            "chip_seconds": self._board.now * 1e-12,
            "worst_lag_ms": pacer.worst_lag * 1e-9,
        }

    def lines(self) -> list[str]:
        """Return what has happened, for people."""
        summary = self.summary()
        parts = ", ".join(summary["chips"].values())
        return [
            f"{self.demo.title}: {parts} in process {summary['board_process']},"
            f" host in process {summary['host_process']}",
            f"link {summary['link']}",
            *self._steps,
            f"{summary['bus_cycles']} bus cycles in {summary['chip_seconds']:.2f} s of chip time,"
            f" worst lag {summary['worst_lag_ms']:.1f} ms,"
            f" {' '.join([str(summary['violations']), 'violations', *summary['rules_broken']])},"
            f" encoder at {', '.join(map(str, summary['encoders']))}",
            "ok: every move ended where it should" if summary["ok"] else "FAILED",
        ]


def _result(report: dict[str, Any]) -> str:
    mark = "ok" if report["ok"] else "NOT"
    near = f" ±{report['tolerance']}" if report["tolerance"] else ""
    found, expected = report["found"], report["expected"]
    if report["digits"]:
        found, expected = (f"{value:0{report['digits']}X}h" for value in (found, expected))
    return (
        f"  {mark:<3} {report['what']} {found} (expected {expected}{near})"
        f" after {report['seconds']:.3f} s"
    )
