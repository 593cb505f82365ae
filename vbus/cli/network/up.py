"""``vbus up``: a machine of nodes as one; ``vbus trace``: what has happened on all of them."""

import json
import sys
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.look.scope_page import refuse_detached, scope_option
from vbus.cli.output import complain, endpoint_option, seconds_option, serving_options, show
from vbus.core import exit_codes
from vbus.core.addresses import refused_endpoint
from vbus.serve.output_file import OutputFile

if TYPE_CHECKING:
    from vbus.boardfile.sections import BoardFile
    from vbus.cli.processes import Child, Processes
    from vbus.serve.nodes.processes import Meeting, Process

_ROUTER: Final = "router"
# -P: a file called vbus.py in the working folder is not imported in place of vbus.
_VBUS: Final = (sys.executable, "-P", "-m", "vbus")


@click.command("up")
@click.argument("machine")
@click.option("--scenario", metavar="FILE", help="What hosts do at given instants.")
@click.option("--trace", metavar="FILE", help="Write what happened on all nodes, merged.")
@serving_options
@scope_option
@seconds_option(
    "--patience", default=0,
    text="How long the others wait for a node whose link is cut; else it is an error at once.",
)  # fmt: skip
@endpoint_option(
    "--router",
    text="Start a router there, in place of what the file says; port 0 is a free one.",
)  # fmt: skip
@seconds_option("--timeout", default=10.0, text="How long a process may take to end; else 10 s.")
def up(
    machine: str, scenario: str | None, trace: str | None, patience: float, router: str | None,
    timeout: float, as_json: bool, detach: bool, rate: float | None, start: str | None,
    scope: str | None, metrics: str, record: dict[str, str],
) -> int:  # fmt: skip
    """Start a machine of nodes on this computer, and end it as one.

    MACHINE is a board file with nodes. Each node has a process of its own, or shares one with the
    nodes that have the same "process". A router is started where they need one. What they say is
    shown with their names in front. Ctrl-C ends all of them; so does the end of one.
    """  # fmt: skip
    from vbus.board.config import read_board_file
    from vbus.serve.nodes.node_records import join_waves
    from vbus.serve.nodes.processes import meeting_of, processes_of
    from vbus.serve.serving import recorded

    passed = {
        "--scenario": scenario, "--patience": patience or None, "--rate": rate, "--from": start,
        "--metrics": metrics, **{f"--{name}": value for name, value in record.items()},
    }  # fmt: skip
    file, _ = read_board_file(machine)
    processes = processes_of(file)
    refuse_detached(scope is not None, detach)
    # A fixed port would be taken by the first process, and the others would fail.
    if metrics and len(processes) > 1 and not metrics.endswith(":0"):
        raise click.UsageError(
            f'--metrics: "{metrics}" is one page, and each of the {len(processes)} processes has'
            f' its own; write "{metrics.rpartition(":")[0]}:0", and each says where its page is'
        )
    if trace and not scenario:
        raise click.UsageError("--trace is for a machine with a --scenario, which ends by itself")
    if detach:
        from vbus.cli.run.detach import go_on_in_background

        go_on_in_background(file.board.name)
    with TemporaryDirectory(prefix="vbus-up-") as folder, ExitStack() as opened:
        made = opened.enter_context(closing(OutputFile(trace))) if trace else None
        given = [word for key, value in passed.items() if value for word in (key, str(value))]
        run = _MachineRun(
            file, machine, processes, meeting_of(file, router or "", opened), as_json, Path(folder),
            given, scope, made,
        )  # fmt: skip
        code = run.carry_out(timeout)
    if len(processes) > 1:
        waves = recorded(file, {"wave": record["wave"]} if "wave" in record else {}, "")
        if join_waves(waves, complain):
            code = code or exit_codes.FAILURE
    return code


@dataclass(eq=False)
class _MachineRun:
    """A machine from its start to its end.

    Attributes:
        file: the board.
        path: name of its file.
        processes: which nodes share one.
        meeting: where they meet.
        json: whether JSON is printed when it is ready.
        folder: for traces of the processes.
        given: options that all processes take.
        scope: where its page is to be; None for none.
        trace: file that takes the traces of all.
    """

    file: "BoardFile"
    path: str
    processes: "tuple[Process, ...]"
    meeting: "Meeting"
    json: bool
    folder: Path
    given: list[str]
    scope: str | None
    trace: OutputFile | None
    _told: list[dict[str, Any]] = field(default_factory=list)

    def carry_out(self, timeout: float) -> int:
        """Run it; return the exit code. Each process may take ``timeout`` seconds to end."""
        from vbus.cli.processes import ProcessDiedError, Processes
        from vbus.cli.status_lines import READY
        from vbus.serve.loop import tell_ready

        # A scenario has an end: then processes that are ready end by themselves.
        ends = "--scenario" in self.given
        names = [_label(process) for process in self.processes]
        width = max(map(len, [*names, _ROUTER] if self.meeting.router else names))
        code = exit_codes.OK
        done = False

        def may_end(child: "Child") -> bool:
            return ends and child.ready

        # With --json what reads standard output finds nothing else there.
        with Processes(partial(click.echo, err=self.json), timeout, width) as children:
            try:
                if self._begin(children, may_end):
                    about = {"board": self.file.board.name, "meets": self.meeting.said}
                    show(self.json, {**about, "nodes": self._told}, [READY])
                    tell_ready()
                    nodes = [child for child in children.children if child.name != _ROUTER]
                    done = children.until(lambda: all(child.ended for child in nodes), may_end)
            except ProcessDiedError as error:
                complain(str(error))
                code = error.code if error.code >= 0 else exit_codes.FAILURE
        for sentence in children.killed:
            complain(sentence)
        # A process that had to be killed has left its files unfinished.
        if children.killed:
            code = code or exit_codes.FAILURE
        if self.trace is not None and done and not code:
            self._merge(self.trace)
        return code

    def _begin(self, children: "Processes", may_end: Callable[["Child"], bool]) -> bool:
        """Start the processes; return whether all are ready before the user asks for the end."""
        from vbus.cli.run.run import is_first

        if not self.json and self.meeting.said:
            click.echo(f"{self.file.board.name}: its nodes meet at {self.meeting.said}")
        if self.meeting.router:
            command = [*_VBUS, "router", "--listen", self.meeting.router]
            if self.file.zenoh.remote and refused_endpoint(self.meeting.router, remote=False):
                command.append("--remote")
            router = children.start(_ROUTER, _ROUTER, command, self._router_says)
            if not children.until(lambda: router.ready):
                return False
        for process in self.processes:
            command = [*_VBUS, "run", self.path, "--json", *self.given]
            for endpoint in self.meeting.connect:
                command += ["--connect", endpoint]
            if self.scope is not None and is_first(self.file, process.nodes):
                command += ["--scope", self.scope]
            for node in process.nodes:
                command += ["--node", node]
            if self.trace is not None:
                command += ["--trace", str(self._trace(process))]
            several = "nodes" if len(process.nodes) > 1 else "node"
            what = f"{several} {' and '.join(process.nodes)}"
            children.start(_label(process), what, command, self._node_says)
        return children.until(lambda: all(child.ready for child in children.children), may_end)

    def _router_says(self, child: "Child", line: str) -> bool:
        from vbus.cli.status_lines import READY

        if child.ready or line != READY:
            return not child.ready  # its endpoints are said already
        child.ready = True
        return True

    def _node_says(self, child: "Child", line: str) -> bool:
        """Take the line in which a process tells that its nodes are ready."""
        from vbus.cli.status_lines import ready_lines

        if child.ready or not line.startswith('{"nodes":'):
            return False
        child.ready = True
        for status in json.loads(line)["nodes"]:
            self._told.append(status)
            if not self.json:
                click.echo(f"node {status['node']['node']}: ready, process {child.pid}")
                for line in ready_lines(status)[1:]:
                    click.echo(line)
        return True

    def _trace(self, process: "Process") -> Path:
        return self.folder / f"{process.name}.trace"

    def _merge(self, file: OutputFile) -> None:
        """Write the traces of all processes as one, and say its hash."""
        from vbus.serve.nodes.nodes import read_traces

        lines, digest = read_traces([self._trace(process) for process in self.processes])
        file.write("".join(lines).encode())
        click.echo(f"trace hash {digest} of {len(lines)} lines")


def _label(process: "Process") -> str:
    return process.name if process.name in process.nodes else "+".join(process.nodes)


@click.command("trace")
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def trace(files: tuple[str, ...], as_json: bool) -> None:
    """Merge the traces of all nodes of a run and print the SHA-256 of what happened.

    FILEs are what "vbus run --trace" has written, one for each process. The hash is the same
    however many processes ran the nodes.
    """
    from vbus.serve.nodes.nodes import read_traces

    lines, digest = read_traces(files)
    show(as_json, {"hash": digest, "events": len(lines)}, [f"{digest}  {len(lines)} events"])
