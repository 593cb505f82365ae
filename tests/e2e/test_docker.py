"""The image without an engine: steps in a clean folder, the check, services as processes."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from tests.schemas import mistakes
from tests.waiting import until
from vbus.network.session import free_endpoint

DOCKER = Path(__file__).parents[2] / "docker"
ROOT = DOCKER.parent
DOCKERFILE = (DOCKER / "Dockerfile").read_text()
COMPOSE = DOCKER / "compose.yaml"
HOST = DOCKER / "host.yaml"
PATIENCE = 120.0
ROUTER = re.compile(r"tcp/(router|0\.0\.0\.0):7447")


def services() -> dict[str, Any]:
    """Return the services of both files, merged as an engine does it."""
    found: dict[str, Any] = {}
    for file in (COMPOSE, HOST):
        for name, service in YAML(typ="safe").load(file)["services"].items():
            found[name] = found.get(name, {}) | service
    return found


def sent() -> list[str]:
    """Return what .dockerignore lets into the image's steps."""
    lines = (ROOT / ".dockerignore").read_text().splitlines()
    return [line.removeprefix("!") for line in lines if line.startswith("!")]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Do the image's steps with the files it has; return the folder of the programs."""
    folder = tmp_path_factory.mktemp("image")
    context = folder / "context"
    for name in sent():
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, context / name, ignore=shutil.ignore_patterns("*.pyc"))
        else:
            (context / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, context / name)
    places = {"/opt/install.sh": "docker/install.sh", "/wheels": f"{folder}/wheels"}
    steps = re.findall(r"^\s*(?:RUN )?(\S*/install\.sh (?:wheels|venv) [^\\\n]*)", DOCKERFILE, re.M)
    assert len(steps) == 2
    for step in steps:
        words = [places.get(word, word) for word in step.split()]
        words = [f"{folder}/vbus" if word == "/opt/vbus" else word for word in words]
        done = subprocess.run(
            words, cwd=context, env=environment(folder), capture_output=True, text=True
        )
        if "No matching distribution" in done.stderr or "No such host" in done.stderr:
            pytest.skip(f"no package index: {done.stderr}")
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "vbus" / "bin"


def environment(folder: Path) -> dict[str, str]:
    """Return an environment that knows nothing of this checkout."""
    known = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    known["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    if os.environ.get("VBUS_TEST_IMAGE") != "1":
        # Compiling takes minutes. What builds a wheel is here already; pip reads 0 as "none".
        known |= {"VBUS_PURE": "1", "PIP_NO_BUILD_ISOLATION": "0"}
    return known


class Service:
    """One service of the compose file: a process with a runtime folder of its own."""

    def __init__(self, name: str, programs: Path, folder: Path, endpoint: str) -> None:
        self.name: str = name
        self.asked: dict[str, Any] = services()[name]
        self._folder: Path = folder
        self._endpoint: str = endpoint
        self.output: Path = folder / f"{name}.txt"
        runtime = folder / f"run-{name}"
        self._environment: dict[str, str] = {
            "PATH": f"{programs}:/usr/bin:/bin",
            "HOME": str(folder),
            "VBUS_RUNTIME": str(runtime),
        }
        [entry] = re.findall(r"^ENTRYPOINT (\[.*\])", DOCKERFILE, re.MULTILINE)
        command = self.asked.get("entrypoint", json.loads(entry)) + self.asked["command"]
        with self.output.open("w") as output:
            self.popen = subprocess.Popen(
                # The endpoint is of this computer here, so no other one is let in.
                [self._here(word) for word in command if word != "--remote"],
                cwd=folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def _here(self, word: str) -> str:
        word = word.replace("/boards", f"{self._folder}/demo").replace("/opt", str(DOCKER))
        return ROUTER.sub(self._endpoint, word)

    def health(self) -> tuple[int, str]:
        """Run the check of the service; return its exit code and what it says."""
        check = self.asked.get("healthcheck", {}).get("test")
        if check is None:
            [words] = re.findall(r"HEALTHCHECK .*\\\n\s+CMD (\[.*\])", DOCKERFILE)
            check = ["CMD", *json.loads(words)]
        done = subprocess.run(
            [self._here(word) for word in check[1:]],
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert done.stderr == ""
        return done.returncode, done.stdout

    def until_healthy(self) -> None:

        def healthy() -> bool:
            assert self.popen.poll() is None, self.output.read_text()
            return not self.health()[0]

        until(healthy, self.output.read_text, every=0.2)  # each look is a process

    def stop(self, number: int = signal.SIGTERM) -> int:
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGCONT)
            self.popen.send_signal(number)
        return self.popen.wait(PATIENCE)


class Machine:
    """The services of the compose file, started in the order it asks for."""

    def __init__(self, programs: Path, folder: Path) -> None:
        self._programs: Path = programs
        self._folder: Path = folder
        self._endpoint: str = free_endpoint()
        self.running: dict[str, Service] = {}
        shutil.copytree(DOCKER / "demo", folder / "demo")
        board = folder / "demo" / "three_axes.toml"
        board.write_text(ROUTER.sub(self._endpoint, board.read_text()))

    def start(self, name: str) -> Service:
        if name not in self.running:
            for earlier, condition in services()[name].get("depends_on", {}).items():
                assert condition == {"condition": "service_healthy"}
                self.start(earlier)
            for earlier in services()[name].get("depends_on", {}):
                self.running[earlier].until_healthy()
            self.running[name] = Service(name, self._programs, self._folder, self._endpoint)
        return self.running[name]


@pytest.fixture
def machine(installed: Path, tmp_path: Path) -> Iterator[Machine]:
    made = Machine(installed, tmp_path)
    yield made
    for service in made.running.values():
        service.stop(signal.SIGKILL)


def test_the_compose_files_are_some() -> None:
    assert mistakes("vendor.compose-spec", COMPOSE, HOST) == ""


def test_the_units_start_what_the_compose_file_starts() -> None:
    units = {path.name: path.read_text() for path in (DOCKER / "systemd").iterdir()}
    wanted = re.search(r"^Wants=(.*)$", units["three-axes.target"], re.MULTILINE)
    assert wanted is not None
    started = []
    for name in wanted[1].split():
        template, at, instance = name.removesuffix(".service").partition("@")
        command = re.search(r"^ExecStart=\S+ (.*)$", units[f"{template}{at}.service"], re.MULTILINE)
        assert command is not None
        started.append(command[1].replace("%i", instance).replace("/etc/vbus/", "/boards/").split())
    services = YAML(typ="safe").load(COMPOSE)["services"]
    assert started == [service["command"] for service in services.values()]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not here")
def test_systemd_takes_the_units(tmp_path: Path) -> None:
    for path in (DOCKER / "systemd").iterdir():
        text = path.read_text().replace("/opt/vbus/bin/vbus", "/bin/true")  # it must be there
        (tmp_path / path.name).write_text(text)
    names = [path.name.replace("@.", "@x.") for path in tmp_path.iterdir()]
    shutil.copy(tmp_path / "three-axes@.service", tmp_path / "three-axes@x.service")
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *(f"./{name}" for name in names)],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_the_image_is_made_from_files_that_are_sent_and_runs_as_nobody_special() -> None:
    stages = DOCKERFILE.split("\nFROM ")
    assert len(stages) == 3
    for copied in re.findall(r"^COPY (.*) \S+$", DOCKERFILE, re.MULTILINE):
        for name in copied.split():
            assert (ROOT / name).exists()
            assert name in sent()
    assert "gcc" in stages[1]
    assert "gcc" not in stages[2]
    assert "\nUSER vbus\n" in stages[2]


def test_the_services_move_three_axes_by_the_commands_of_the_compose_file(machine: Machine) -> None:
    host = machine.start("host")
    assert host.popen.wait(PATIENCE) == 0, host.output.read_text()
    said = host.output.read_text()
    assert said.endswith("all axes have arrived\n"), said
    assert [f"node {name}: 1 requests" in said for name in "xyz"] == [True] * 3, said
    assert "nodes were apart in wall time by p50" in said, said
    # The first node that is stopped ends well; the others may say that it has gone.
    assert machine.running["x"].stop() == 0
    assert machine.running["router"].stop() == 0


def test_the_check_tells_a_living_board_from_a_dead_or_a_stalled_one(machine: Machine) -> None:
    axes = [machine.start(name) for name in "xyz"]
    for axis in axes:
        axis.until_healthy()
    x, y, _ = axes
    x.popen.send_signal(signal.SIGSTOP)
    code, said = x.health()
    assert (code, "machine.x: " in said) == (1, True)
    x.popen.send_signal(signal.SIGCONT)
    y.popen.kill()
    y.popen.wait()
    assert y.health() == (1, "no board is running\n")
    router = machine.running["router"]
    router.until_healthy()
    router.stop(signal.SIGKILL)
    code, said = router.health()
    assert code == 1
    assert said.startswith("no router lets others connect: ")
