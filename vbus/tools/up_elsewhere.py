"""A machine of nodes written down: a compose file for containers, units for systemd."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distribution
from typing import Final

from vbus.addresses import stays_here
from vbus.board.sections import BoardFile, HostSection
from vbus.cluster.processes import Process, endpoint_parts, processes_of
from vbus.errors import ConfigError, VbusError
from vbus.network.session import check_endpoint
from vbus.nodes.plan import part_of

PINNED: Final = re.compile(r"[^\s@]+@sha256:[0-9a-f]{64}")
"""What the name of an image looks like that is always the same image."""
PROGRAM: Final = "/opt/vbus/bin/vbus"
"""Where units expect the command."""
BOARDS: Final = "/etc/vbus"
"""Where units expect board files; in an image it is ``/boards``."""
STOP_SECONDS: Final = 20
"""How long nodes may take to end."""
_ROUTER: Final = "router"


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """What has been made.

    Attributes:
        files: texts by file name.
        notices: sentences about what is left to do.
    """

    files: dict[str, str]
    notices: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _Router:
    """The router of a machine.

    Attributes:
        host: what others call the computer or container it is on.
        port: where it listens.
    """

    host: str
    port: int

    @property
    def command(self) -> list[str]:
        """What starts it, after ``vbus``."""
        words = ["router", "--listen"]
        if stays_here(self.host):
            return [*words, f"tcp/{self.host}:{self.port}"]
        return [*words, f"tcp/0.0.0.0:{self.port}", "--remote"]


def images_of(file: BoardFile, image: str, unpinned: bool) -> dict[str, str]:
    """Return the image of each process by its name, and that of a router.

    Args:
        file: the board file.
        image: in place of what the file says; empty if it says enough.
        unpinned: an image may be named without its digest.

    Raises:
        ConfigError: an image is missing, or may be another one tomorrow.
    """
    processes = processes_of(file)
    found = {process.name: image or process.image for process in processes}
    for process in processes:
        name = found[process.name]
        if not name:
            raise ConfigError(
                f"{file.path}: which image has node {process.nodes[0]}? write image ="
                ' "NAME@sha256:..." in its section, or say --image'
            )
        if not unpinned and not PINNED.fullmatch(name):
            raise ConfigError(
                f'"{name}" may be another image tomorrow; write NAME@sha256: and 64 digits ("docker'
                ' image inspect" shows them as RepoDigests), or say --unpinned'
            )
    return found | {_ROUTER: next(iter(found.values()))}


def _router_of(file: BoardFile, names: Iterable[str], in_containers: bool) -> _Router | None:
    """Return the router to be started for a machine; None if there is nothing to start.

    Raises:
        ConfigError: the processes could not meet where the board file says.
    """
    processes = processes_of(file)
    for node in file.nodes:
        if node.listen:
            home = next(process.name for process in processes if node.name in process.nodes)
            _, host, port = endpoint_parts(node.listen)
            if in_containers and len(processes) > 1 and host != home:
                raise ConfigError(
                    f"{file.path}: node {node.name} listens at {node.listen}, which other"
                    f' containers do not reach; write "tcp/{home}:{port}", and remote = true in'
                    " [zenoh]"
                )
            return None
    if not file.zenoh.connect:
        if len(processes) > 1:
            raise ConfigError(
                f"{file.path}: where do the nodes meet? write connect ="
                ' ["tcp/router:7447"] in [zenoh]: the name of the computer or container the router'
                " is on"
            )
        return None
    endpoint = file.zenoh.connect[0]
    check_endpoint(endpoint.replace("tls/", "tcp/", 1))
    protocol, host, port = endpoint_parts(endpoint)
    if in_containers and stays_here(host):
        raise ConfigError(
            f"{file.path}: {endpoint} is each container's own; write connect ="
            f' ["tcp/router:{port}"] in [zenoh]'
        )
    if protocol == "tls" or (in_containers and not re.fullmatch(r"[a-z0-9][a-z0-9_-]*", host)):
        return None
    if in_containers and host in names:
        raise ConfigError(
            f'{file.path}: the router at {endpoint} and the node "{host}" would be one container;'
            " give the router another name"
        )
    return _Router(host, port)


def _own_router(file: BoardFile, router: _Router | None) -> list[str]:
    """Return a sentence on a router that others have to start."""
    if router is not None or not file.zenoh.connect or any(node.listen for node in file.nodes):
        return []
    return [f"the router at {', '.join(file.zenoh.connect)} is not part of this; start it there"]


def _hosts(file: BoardFile, process: Process) -> list[HostSection]:
    """Return the hosts of a process."""
    return [host for node in process.nodes for host in part_of(file, node).hosts]


# -- containers --------------------------------------------------------------------------------


def compose(file: BoardFile, board: str, images: dict[str, str]) -> WrittenFiles:
    """Return a compose file: a service for each process, and for the router.

    Args:
        file: the board file.
        board: its place, seen from the compose file.
        images: as of :func:`images_of`.

    Raises:
        ConfigError: the containers could not meet.
        VbusError: a process needs what a container cannot have.
    """
    processes = processes_of(file)
    router = _router_of(file, images.keys() - {_ROUTER}, in_containers=True)
    notices = _own_router(file, router)
    ports = {process.name: _ports(file, process, notices) for process in processes}
    internal = not any(ports.values()) and not (router is None and file.zenoh.connect)
    inside = board.rpartition("/")[2]
    volumes = [f"./{board}:/boards/{inside}:ro"]
    for secret in (file.zenoh.certificate, file.zenoh.key, file.zenoh.authority):
        if secret and not secret.startswith("/"):
            volumes.append(f"./{secret}:/boards/{secret}:ro")
            notices.append(f"{secret} belongs beside compose.yaml")
    project = re.sub(r"[^a-z0-9_-]", "-", f"vbus-{file.board.name}".lower())
    lines = [
        f'# Made from {board} by "vbus up --write compose"; change that, and write it again.',
        "",
        f"name: {project}",
        "",
        "x-vbus: &vbus",
        "  networks: [machine]",
        "  init: true",
        "  read_only: true",
        "  cap_drop: [ALL]",
        '  security_opt: ["no-new-privileges:true"]',
        '  tmpfs: ["/run/vbus:uid=10001,gid=10001,mode=0700"]',
        f"  volumes: {_flow(volumes)}",
        f"  stop_grace_period: {STOP_SECONDS}s",
        "",
        "services:",
    ]
    if router is not None:
        lines += _router_service(router, images[_ROUTER])
    for process in processes:
        nodes = [word for node in process.nodes for word in ("--node", node)]
        lines += [
            f"  {process.name}:",
            "    <<: *vbus",
            f"    image: {json.dumps(images[process.name])}",
            f"    command: {_flow(['run', f'/boards/{inside}', *nodes])}",
        ]
        if ports[process.name]:
            lines.append(f"    ports: {_flow(ports[process.name])}")
        if router is not None:
            lines += ["    depends_on:", f"      {router.host}: {{ condition: service_healthy }}"]
        lines.append("")
    lines += ["networks:", "  machine:", f"    internal: {json.dumps(internal)}", ""]
    return WrittenFiles({"compose.yaml": "\n".join(lines)}, notices)


def _router_service(router: _Router, image: str) -> list[str]:
    return [
        f"  {router.host}:",
        "    <<: *vbus",
        f"    image: {json.dumps(image)}",
        f"    command: {_flow(router.command)}",
        "    healthcheck:",
        "      test: [CMD, /opt/healthcheck.py, --router]",
        "      interval: 2s",
        "      timeout: 10s",
        "      retries: 5",
        "      start_period: 10s",
        "",
    ]


def _flow(words: Iterable[str]) -> str:
    """Return a list as YAML has it in one line."""
    return json.dumps(list(words), ensure_ascii=False)


def _ports(file: BoardFile, process: Process, notices: list[str]) -> list[str]:
    """Return the ports of a process that its computer shall have too, on the loopback alone.

    Raises:
        VbusError: a host is at a device of the computer.
    """
    found = []
    for host in _hosts(file, process):
        kind, _, rest = host.transport.partition(":")
        address, _, port = rest.rpartition(":")
        if kind == "serial":
            raise VbusError(
                f"{host.transport} is a device of one computer; run node"
                f" {process.nodes[0]} there with --write systemd"
            )
        if kind not in ("tcp", "rfc2217") or not port.isdecimal() or port == "0":
            continue
        if not address or stays_here(address):
            notices.append(
                f"{host.transport} is reached within the container of {process.name} alone; write"
                f' "{kind}:0.0.0.0:{port}" and remote = true to have it outside'
            )
        else:
            found.append(f"127.0.0.1:{port}:{port}")
    return found


# -- systemd -----------------------------------------------------------------------------------


def systemd(file: BoardFile, board: str) -> WrittenFiles:
    """Return units of systemd: a service for each process and for the router, and a target of all.

    Args:
        file: the board file.
        board: its name in the folder of board files.

    Raises:
        ConfigError: the processes could not meet.
    """
    processes = processes_of(file)
    machine = f"vbus-{file.board.name}"
    router = _router_of(file, (), in_containers=False)
    notices = _own_router(file, router)
    first = [f"{machine}-router.service"] if router is not None else []
    if router is not None and any(process.name == _ROUTER for process in processes):
        raise ConfigError(f'{file.path}: no process may be called "router", as its router is')
    head = f'# Made from {board} by "vbus up --write systemd"; change that, and write it again.'
    files = {}
    if router is not None:
        command = [PROGRAM, *router.command]
        files[first[0]] = _unit(head, f"router of {file.board.name}", machine, [], command)
    for process in processes:
        nodes = [word for node in process.nodes for word in ("--node", node)]
        several = "nodes" if len(process.nodes) > 1 else "node"
        files[f"{machine}-{process.name}.service"] = _unit(
            head,
            f"{several} {' and '.join(process.nodes)} of {file.board.name}",
            machine,
            first,
            [PROGRAM, "run", f"{BOARDS}/{board}", *nodes],
        )
    services = " ".join(files)
    files[f"{machine}.target"] = (
        f"{head}\n# A computer that has only some of its services starts those.\n\n"
        f"[Unit]\nDescription=vbus: {file.board.name}\nWants={services}\n\n"
        "[Install]\nWantedBy=multi-user.target\n"
    )
    files["requirements.txt"] = (
        f"{head}\n# python3 -m venv /opt/vbus && /opt/vbus/bin/pip install -r requirements.txt\n"
        + "".join(f"{name}=={version}\n" for name, version in packages())
    )
    notices.append(f"{board} belongs in {BOARDS}, and {PROGRAM} is what requirements.txt installs")
    return WrittenFiles(files, notices)


def _unit(head: str, what: str, machine: str, after: list[str], command: list[str]) -> str:
    """Return a service that says when it is ready, and may do little else than serve."""
    return "\n".join(
        [
            head,
            "",
            "[Unit]",
            f"Description=vbus: {what}",
            f"PartOf={machine}.target",
            "Wants=network-online.target",
            f"After={' '.join(['network-online.target', *after])}",
            "",
            "[Service]",
            "Type=notify",
            f"ExecStart={' '.join(command)}",
            "DynamicUser=yes",
            "User=vbus",
            "RuntimeDirectory=vbus",
            "RuntimeDirectoryMode=0700",
            "RuntimeDirectoryPreserve=yes",
            "Environment=VBUS_RUNTIME=/run/vbus",
            "StateDirectory=vbus",
            "WorkingDirectory=/var/lib/vbus",
            "# Nodes wait for those that have not come.",
            "TimeoutStartSec=infinity",
            f"TimeoutStopSec={STOP_SECONDS}",
            "NoNewPrivileges=yes",
            "ProtectSystem=strict",
            "ProtectHome=yes",
            "CapabilityBoundingSet=",
            "",
            "[Install]",
            f"WantedBy={machine}.target",
            "",
        ]
    )


def packages() -> list[tuple[str, str]]:
    """Return vbus and all it needs to run, as they are installed here: names and versions."""
    found: dict[str, tuple[str, str]] = {}
    waiting = ["vbus"]
    while waiting:
        name = re.sub(r"[-_.]+", "-", waiting.pop()).lower()
        if name in found:
            continue
        try:
            there = distribution(name)
        except PackageNotFoundError:  # for another system or another Python
            continue
        found[name] = (name, there.version)
        for wanted in there.requires or ():
            requirement, _, marker = wanted.partition(";")
            if "extra" not in marker:
                match = re.match(r"[A-Za-z0-9._-]+", requirement.strip())
                waiting += [match[0]] if match else []
    return [found.pop("vbus"), *sorted(found.values())] if "vbus" in found else []
