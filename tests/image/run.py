#!/usr/bin/env python3
"""Builds the image of ``docker/Dockerfile`` and runs machines from it: ``tests/image/run.py``.

No container engine is needed, but root on Linux, and Debian's mmdebstrap, buildah, util-linux and
iproute2. The base is a Debian made here, the steps of the Dockerfile are carried out by buildah in
a chroot, and a container is a process with mounts, process numbers and a network of its own: what
the image says of user, folder, environment, command and health check is what it gets, and the
compose files say the rest.

Exit code 77 means that this computer cannot: it says why.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML

ROOT: Final = Path(__file__).resolve().parents[2]
WORK: Final = ROOT / "build" / "image"
"""Kept, so that the next run has a base and the packages."""
DOCKER: Final = ROOT / "docker"
BASE: Final = "docker.io/library/python:3.12-slim"
MIRROR: Final = os.environ.get("VBUS_DEBIAN", "http://deb.debian.org/debian")
TOOLS: Final = ("mmdebstrap", "buildah", "unshare", "nsenter", "mount", "ip")
CANNOT: Final = 77
PATIENCE: Final = 120.0
STOP_SECONDS: Final = 20.0

MACHINE: Final = """\
[board]
name = "three"
time = "lockstep"
power_on = "done"

[zenoh]
connect = ["tcp/router:7447"]

[nodes.a]

[nodes.b]

[nodes.c]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
node = "a"

[chips.y]
part = "MCP-1200"
clock = "8 MHz"
plant = "none"
node = "b"

[chips.z]
part = "LM629N-6"
clock = "6 MHz"
plant = "none"
node = "c"

[plants.motor]
model = "dc_motor"

[nets]
"DONE" = { pins = ["x.HI", "z./IN"], delay = "300 us" }
"""
SCENARIO: Final = """\
1ms    x+z w 0 1e
1.1ms  x+z w 1 0 8
1.2ms  x+z w 1 1 2c
1.3ms  x+z w 0 4
2ms    x+z w 0 1f
2.1ms  x+z w 1 0 8
2.2ms  x+z w 1 0 4
2.3ms  x+z w 1 0 0
2.5ms  y   w 5 3
3ms    x+z w 0 1
9ms    x   r 0
9ms    y   r 5
end    20ms
"""


class CannotHereError(Exception):
    """Something that this computer does not have or allow."""


# -- building --------------------------------------------------------------------------------------


def run(*words: str | Path, cwd: Path | None = None, env: Mapping[str, str] | None = None) -> str:
    """Run a program to its end and return what it says."""
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, cwd=cwd, env=env)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, words))}: {done.stdout}{done.stderr}")
    return done.stdout


def buildah(*words: str | Path) -> str:
    """Run buildah with a storage of its own."""
    store = ("--storage-driver", "vfs", "--root", WORK / "store", "--runroot", WORK / "store-run")
    return run("buildah", *store, *words, cwd=ROOT)


def make_base() -> None:
    """Make what the Dockerfile begins with: a Debian with its Python, and a compiler to spare."""
    tar = WORK / "base.tar"
    if not tar.exists():
        part = tar.with_suffix(".part")
        packages = "python3,python3-venv,python3-pip,python3-dev,ca-certificates,gcc,libc6-dev"
        try:
            run("mmdebstrap", "--variant=minbase", "--format=tar", f"--include={packages}",
                "bookworm", part, MIRROR)  # fmt: skip
        except RuntimeError as error:
            raise CannotHereError(f"no Debian from {MIRROR}: {error}") from None
        part.rename(tar)
    container = buildah("from", "scratch").strip()
    buildah("add", "-q", container, tar, "/")
    buildah("commit", "-q", "--rm", container, BASE)


def fetch_packages() -> None:
    """Fetch with this computer's pip what pip needs in the image, which has no index."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"]
    needed = [*project["project"]["dependencies"], *extras["wave"], *extras["metrics"]]
    container = buildah("from", "--pull-never", BASE).strip()
    tell = "import sys; print('%d.%d' % sys.version_info[:2])"
    version = buildah("run", "--isolation", "chroot", container, "python3", "-c", tell).strip()
    buildah("rm", container)
    try:
        run(sys.executable, "-m", "pip", "download", "-q", "-d", WORK / "packages",
            "--python-version", version, "--only-binary=:all:",
            *needed, *project["build-system"]["requires"])  # fmt: skip
    except RuntimeError as error:
        raise CannotHereError(f"no packages: {error}") from None
    (WORK / "pip.conf").write_text("[global]\nno-index = true\nfind-links = /packages\n")


def build(compiled: bool) -> None:
    """Carry out the Dockerfile."""
    buildah(
        "bud", "-q", "--format", "docker", "--pull-never", "--isolation", "chroot",
        "-v", f"{WORK}/packages:/packages:ro", "-v", f"{WORK}/pip.conf:/etc/pip.conf:ro",
        "--build-arg", f"VBUS_PURE={0 if compiled else 1}", "-f", DOCKER / "Dockerfile",
        "-t", "vbus", ".",
    )  # fmt: skip


# -- running ---------------------------------------------------------------------------------------

ENTER: Final = """\
set -e
mount --bind "$ROOT" "$ROOT"
mount -o remount,bind,ro "$ROOT"
mount -t proc proc "$ROOT/proc"
mount --rbind /dev "$ROOT/dev"
mount --bind "$HOSTS" "$ROOT/etc/hosts"
mount -t tmpfs -o "$TMPFS" tmpfs "$ROOT/run/vbus"
mount --bind "$BOARDS" "$ROOT/boards"
mount -o remount,bind,ro "$ROOT/boards"
if [ -n "$OUT" ]; then mount --bind "$OUT" "$ROOT/boards/out"; fi
exec chroot "$ROOT" "$@"
"""


class Image:
    """What an image says, and the files it has.

    Args:
        folder: its files.
        said: its settings, as buildah tells them.
    """

    def __init__(self, folder: Path, said: dict[str, Any]) -> None:
        config = said["Docker"]["config"]
        self.folder: Path = folder
        self.environment: dict[str, str] = dict(one.split("=", 1) for one in config["Env"])
        self.entry: list[str] = config["Entrypoint"]
        self.user: str = config["User"]
        self.place: str = config["WorkingDir"]
        self.health: list[str] = config["Healthcheck"]["Test"]

    def become(self, words: Sequence[str]) -> list[str]:
        """Return what runs a command in the image as its user, who may become nobody else."""
        rights = (
            f"--reuid={self.user}", f"--regid={self.user}", "--clear-groups", "--no-new-privs",
            "--bounding-set=-all", "--inh-caps=-all",
        )  # fmt: skip
        names = [f"{name}={value}" for name, value in self.environment.items()]
        return ["setpriv", *rights, "env", "-i", f"--chdir={self.place}", *names, *words]


class Container:
    """A process of the image that sees nothing else, and can write to its runtime folder only.

    Args:
        image: what it is made of.
        folder: becomes ``/boards``, which it may read.
        words: its command, after the entry point.
        entry: another entry point.
        check: another health check.
        out: a folder it may write to, as ``/boards/out``.
        tmpfs: options of its runtime folder.
    """

    def __init__(
        self,
        image: Image,
        folder: Path,
        words: Sequence[str],
        *,
        entry: Sequence[str] | None = None,
        check: Sequence[str] | None = None,
        out: Path | None = None,
        tmpfs: str = "uid=10001,gid=10001,mode=0700",
    ) -> None:
        self._image: Image = image
        self._check: Sequence[str] = image.health if check is None else check
        command = image.become([*(image.entry if entry is None else entry), *words])
        self.output: Path = Path(f"{folder}-{len(list(folder.parent.iterdir()))}.txt")
        with self.output.open("w") as output:
            self._popen = subprocess.Popen(
                ["unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", ENTER,
                 "enter", *command],
                env={**os.environ, "ROOT": str(image.folder), "HOSTS": str(WORK / "hosts"),
                     "TMPFS": tmpfs, "BOARDS": str(folder), "OUT": str(out or "")},
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            )  # fmt: skip

    @property
    def said(self) -> str:
        """What it has printed."""
        return self.output.read_text()

    def first(self) -> str:
        """Return its first process; "" until that sees the image and nothing else."""
        children = Path(f"/proc/{self._popen.pid}/task/{self._popen.pid}/children")
        if self._popen.poll() is not None:
            return ""
        for child in children.read_text().split():
            if Path(f"/proc/{child}/root/opt/vbus").exists():
                return child
        return ""

    def healthy(self) -> bool:
        """Tell whether its health check finds it well; raise if it has ended."""
        assert self._popen.poll() is None, self.said
        first = self.first()
        if not first:
            return False
        words = self._image.become(self._check[1:])
        enter = ["nsenter", "--target", first, "--mount", "--pid", "--root", "--wd=/"]
        return subprocess.run([*enter, *words], capture_output=True).returncode == 0

    def wait(self) -> int:
        """Wait for its end; return its exit code."""
        return self._popen.wait(PATIENCE)

    def stop(self) -> tuple[int, float]:
        """End it as ``docker stop`` does; return its exit code and how long that took (s)."""
        begin = time.monotonic()
        os.kill(int(self.first()), signal.SIGTERM)
        return self._popen.wait(STOP_SECONDS), time.monotonic() - begin

    def kill(self) -> None:
        """End it whatever it does, and wait until all of it is gone."""
        if first := self.first():
            os.kill(int(first), signal.SIGKILL)
        else:
            self._popen.kill()
        self._popen.wait()


def until_healthy(container: Container) -> None:
    """Wait until the check of a container finds it well."""
    end = time.monotonic() + PATIENCE
    while not container.healthy():
        assert time.monotonic() < end, container.said
        time.sleep(0.2)


def services(*files: Path) -> dict[str, Any]:
    """Return the services of compose files, merged as an engine does it."""
    found: dict[str, Any] = {}
    for file in files:
        for name, service in YAML(typ="safe").load(file)["services"].items():
            found[name] = found.get(name, {}) | service
    return found


class Machine:
    """Containers of a compose file.

    Args:
        image: what they are made of.
        asked: the services.
        folder: becomes ``/boards``.
        out: a folder they may write to.
    """

    def __init__(
        self, image: Image, asked: dict[str, Any], folder: Path, out: Path | None = None
    ) -> None:
        self._image: Image = image
        self._asked: dict[str, Any] = asked
        self._folder: Path = folder
        self._out: Path | None = out
        self.running: dict[str, Container] = {}

    def start(self, name: str, *more: str) -> Container:
        """Start a service, with more words."""
        asked = self._asked[name]
        assert asked["read_only"]
        assert asked["cap_drop"] == ["ALL"]
        assert asked["security_opt"] == ["no-new-privileges:true"]
        (tmpfs,) = asked["tmpfs"]
        check = asked.get("healthcheck", {}).get("test")
        made = Container(
            self._image, self._folder, [*asked["command"], *more], entry=asked.get("entrypoint"),
            check=check, out=self._out, tmpfs=tmpfs.removeprefix("/run/vbus:"),
        )  # fmt: skip
        self.running[name] = made
        return made

    def until_healthy(self, *names: str) -> None:
        """Wait until the checks of these find them well."""
        for name in names:
            until_healthy(self.running[name])

    def end(self) -> None:
        """Kill what still runs."""
        for container in self.running.values():
            container.kill()


# -- what is tried ---------------------------------------------------------------------------------


def folder_of(name: str, **files: str) -> Path:
    """Make a folder of boards that everybody may read."""
    folder = WORK / "run" / name
    (folder / "out").mkdir(parents=True)
    for file, text in files.items():
        (folder / file.replace("_", ".")).write_text(text)
    return folder


def once(image: Image, folder: Path, *words: str, entry: Sequence[str] | None = None) -> str:
    """Run one container to its end; return what it has said."""
    container = Container(image, folder, words, entry=entry, out=folder / "out")
    container.wait()
    return container.said.strip()


def try_rights(image: Image) -> None:
    """Who a container is, and what it may write to."""
    folder = folder_of("rights")
    told = once(image, folder, "--version")
    assert re.fullmatch(r"vbus \S+ \(\w+ core\)", told), told
    print(f"  {told}")
    told = once(image, folder, "-c", "id -u; id -g; id -G", entry=["sh"])
    assert told.split() == ["10001", "10001", "10001"], told
    told = once(
        image, folder, "-c", "touch /opt/a; touch /boards/a; touch /run/vbus/a && ls /run/vbus",
        entry=["sh"],
    )  # fmt: skip
    assert told.count("Read-only file system") == 2, told
    assert told.endswith("\na"), told
    told = once(image, folder, "CapBnd", "/proc/self/status", entry=["grep"])
    assert int(told.split()[1], 16) == 0, told
    print("  user 10001 without rights; nothing but /run/vbus can be written to")


def try_hash(image: Image) -> None:
    """Three nodes in three containers, and one process here, do the same."""
    folder = folder_of("three", three_toml=MACHINE, three_txt=SCENARIO)
    out = folder / "out"
    os.chown(out, 10001, 10001)
    known = {**os.environ, "VBUS_RUNTIME": f"{WORK}/run/runtime", "PYTHONPATH": str(ROOT)}

    def vbus(*words: str) -> str:
        return run(sys.executable, "-m", "vbus", *words, cwd=folder, env=known)

    text = (DOCKER / "compose.yaml").read_text().replace("demo/three_axes", "three")
    text = text.replace("three_axes", "three")
    for old, new in zip("xyz", "abc", strict=True):
        text = text.replace(f"  {old}:", f"  {new}:").replace(
            f'"--node", "{old}"', f'"--node", "{new}"'
        )
    (folder / "three.yaml").write_text(text)
    vbus("run", "three.toml", "--scenario", "three.txt", "--trace", "one.trace")
    expected = vbus("trace", "one.trace").split()[0]
    asked = services(folder / "three.yaml")
    assert sorted(asked) == ["a", "b", "c", "router"], asked
    machine = Machine(image, asked, folder, out)
    try:
        machine.start("router")
        machine.until_healthy("router")
        names = ("a", "b", "c")
        for name in names:
            machine.start(name, "--scenario", "three.txt", "--trace", f"out/{name}.trace")
        for name in names:
            assert machine.running[name].wait() == 0, machine.running[name].said
        told = once(image, folder, "trace", *(f"out/{name}.trace" for name in names)).split()[0]
        assert told == expected, (told, expected)
        print(f"  three containers and one process: {expected}")
    finally:
        machine.end()


def try_real_time(image: Image) -> None:
    """The machine of docker/compose.yaml: health, a move of three axes, the end."""
    folder = folder_of("axes")
    for file in (DOCKER / "demo").iterdir():
        if file.is_file():
            shutil.copy(file, folder)
    machine = Machine(image, services(DOCKER / "compose.yaml", DOCKER / "host.yaml"), folder)
    try:
        machine.start("router")
        machine.until_healthy("router")
        machine.start("x")
        assert not machine.running["x"].healthy(), "well without the other nodes"
        machine.start("y")
        machine.start("z")
        machine.until_healthy("x", "y", "z")
        host = machine.start("host")
        assert host.wait() == 0, host.said
        assert "all axes have arrived" in host.said, host.said
        # All at once, as "docker compose stop" does: a node that outlives another one by 0.3 s
        # ends with that as its error.
        nodes = [machine.running[name] for name in ("x", "y", "z")]
        for first in [int(node.first()) for node in nodes]:
            os.kill(first, signal.SIGTERM)
        for node in nodes:
            assert node.wait() == 0, node.said
        code, seconds = machine.running["router"].stop()
        assert code == 0, machine.running["router"].said
        print(f"  router: ended {seconds:.1f} s after SIGTERM")
    finally:
        machine.end()


# -- all of it -------------------------------------------------------------------------------------


def check_tools() -> None:
    """Look whether this computer can do it at all."""
    missing = [name for name in TOOLS if shutil.which(name) is None]
    if missing:
        raise CannotHereError(f"not installed: {', '.join(missing)}")
    if not sys.platform.startswith("linux") or os.geteuid() != 0:
        raise CannotHereError("it takes root on Linux")
    try:
        run("unshare", "--mount", "--pid", "--net", "--fork", "ip", "link", "set", "lo", "up")
    except RuntimeError as error:
        raise CannotHereError(f"no mounts or network of one's own: {error}") from None


def try_all() -> None:
    """Try the image in a network that has nothing but itself."""
    run("ip", "link", "set", "lo", "up")
    shutil.rmtree(WORK / "run", ignore_errors=True)
    (WORK / "run").mkdir()
    (WORK / "hosts").write_text("127.0.0.1 localhost router\n")
    container = buildah("from", "--pull-never", "vbus").strip()
    folder = Path(buildah("mount", container).strip())
    image = Image(folder, json.loads(buildah("inspect", "--type", "image", "vbus")))
    for one in (try_rights, try_hash, try_real_time):
        print(str(one.__doc__).rstrip("."))
        one(image)


def main() -> int:
    """Build and try; ``--build`` and ``--try`` do one of them; ``--compiled`` compiles the core."""
    if "--inside" in sys.argv:
        try_all()
        return 0
    try:
        check_tools()
        begin = time.monotonic()
        if "--try" not in sys.argv:
            shutil.rmtree(WORK / "store", ignore_errors=True)
            WORK.mkdir(parents=True, exist_ok=True)
            make_base()
            fetch_packages()
            build("--compiled" in sys.argv)
            print(f"built in {time.monotonic() - begin:.0f} s", flush=True)
    except CannotHereError as error:
        print(f"the image is left out: {error}", file=sys.stderr)
        return CANNOT
    if "--build" in sys.argv:
        return 0
    alone = ("unshare", "--net", "--mount", "--propagation", "private")
    return subprocess.run([*alone, sys.executable, __file__, "--inside"]).returncode


if __name__ == "__main__":
    sys.exit(main())
