"""One mutant, one process: a fork of a warm parent that runs pytest over the mutated module.

The parent has imported pytest, Hypothesis and other libraries, nothing of the package. In the
child, and in every Python that its tests start, an import hook (``finder.py``) gives the mutated
module its changed source; no file is touched.
"""

import contextlib
import gc
import glob
import importlib
import json
import math
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import hypothesis
import pytest

from tests.mutation import finder

MEMORY: Final = 4 << 30
LONGEST_FILE: Final = 1 << 30
WAITS: Final = 12
"""Seconds, for one of processor time, in which nothing of a child may want the processor or a disk:
time that other work has taken makes no time-out."""
LOOK: Final = 0.5
"""Seconds between looks at what a child wants."""

OPTIONS: Final = (
    "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:tests.repeat", "--assert=plain",
)  # fmt: skip
"""Of every run of pytest here; a warm parent has imported what pytest would rewrite."""

PHASES: Final = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
"""What has failed need not be found small."""
SETTINGS: Final = "_hypothesis_internal_use_settings"
FEW: Final = 20
"""Examples of each test that draws them, before all are tried."""


@dataclass(frozen=True, slots=True)
class Task:
    """What a child does.

    Attributes:
        tests: node ids, in the order in which they run.
        limit: seconds of processor time.
        file: the mutated file; empty for none.
        source: its text.
        examples: how many at most Hypothesis draws for a test; 0: as many as the test says.
        log: where what pytest prints goes.
        whole: the run goes on after a test has failed.
    """

    tests: Sequence[str]
    limit: float
    file: str = ""
    source: str = ""
    examples: int = FEW
    log: Path | None = None
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a child ended.

    Attributes:
        verdict: "survived", "killed" or "timeout"; "missing" if a test is not there.
        by: the failed test, "collection", or the signal that ended the process.
        cpu: seconds of processor time.
        wall: seconds.
        failed: of a whole run, all that failed, in the words of ``by``.
    """

    verdict: str
    by: str
    cpu: float
    wall: float
    failed: Sequence[str] = ()


def warm(root: Path) -> None:
    """Import what every child needs; children are forked from here."""
    sys.path.insert(0, str(root))
    # Of processes that tests start, too.
    os.environ["PYTHONPATH"] = os.pathsep.join(
        filter(None, (str(root), finder.SITE, os.environ.get("PYTHONPATH", "")))
    )
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(root / "build" / "mutation" / "pycache")
    os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(root / "build" / "mutation" / "hypothesis")
    for name in ("_hypothesis_pytestplugin", "pytest_asyncio.plugin", "hypothesis.stateful",
                 "hypothesis.internal.conjecture.engine", "hypothesis.core", "msgpack", "msgspec",
                 "click", "rich.console", "serial", "vcd", "zenoh", "asyncio", "unittest.mock",
                 "mypy_extensions"):  # fmt: skip
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    gc.collect()
    gc.freeze()


def draws(item: pytest.Item) -> bool:
    """Whether Hypothesis draws the examples of a test."""
    return bool(getattr(getattr(item, "obj", None), "is_hypothesis_test", False))


def draw(items: Sequence[pytest.Item], examples: int) -> None:
    """Let Hypothesis draw no more than a number of examples, and not look for smaller ones."""
    for item in filter(draws, items):
        test = item.obj  # type: ignore[attr-defined]
        # A state machine has its settings elsewhere, and keeps them.
        if own := getattr(test, SETTINGS, None):
            number = min(own.max_examples, examples or own.max_examples)
            new = hypothesis.settings(own, max_examples=number, phases=PHASES)
            setattr(test, SETTINGS, new)


class _Chosen:
    """Plug-in: runs the chosen tests in their order, and notes what failed first."""

    def __init__(self, tests: Sequence[str], examples: int) -> None:
        self._tests = tests
        self._examples = examples
        self.missing: list[str] = []
        self.failed: list[str] = []

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        there = {item.nodeid: item for item in items}
        self.missing = [name for name in self._tests if name not in there]
        # A mutated table may give cases other names.
        functions = {name.partition("[")[0] for name in self.missing}
        others = [name for name in there if name.partition("[")[0] in functions]
        chosen = dict.fromkeys([name for name in self._tests if name in there] + others)
        items[:] = [there[name] for name in chosen]
        draw(items, self._examples)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.failed.append("collection")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)


def _options(task: Task, folder: str) -> list[str]:
    files = dict.fromkeys(name.partition("::")[0] for name in task.tests)
    end = "--tb=no" if task.whole else "-x"
    return [end, *OPTIONS, f"--basetemp={folder}/pytest", *files]


def _child(root: Path, task: Task, folder: str, answer: int) -> None:
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (LONGEST_FILE, LONGEST_FILE))
    seconds = math.ceil(task.limit)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 2))
    for number in (signal.SIGXCPU, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    # A terminal that a test opens becomes this session's, and is hung up with the test.
    signal.signal(signal.SIGHUP, lambda *_: None)
    log = os.open(task.log or os.devnull, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for stream in (1, 2):
        os.dup2(log, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.chdir(root)
    os.environ["TMPDIR"] = tempfile.tempdir = folder
    if task.file:
        source = Path(folder, "mutated.py")
        source.write_text(task.source)
        os.environ[finder.MUTATED] = os.pathsep.join(
            (str(root / task.file), task.file, str(source))
        )
        finder.install()
    chosen = _Chosen(task.tests, task.examples)
    code = pytest.main(_options(task, folder), plugins=[chosen])
    failed = list(dict.fromkeys(chosen.failed)) if task.whole else chosen.failed[:1]
    os.write(answer, json.dumps([int(code), failed, chosen.missing[:1]]).encode())


def attempt(root: Path, task: Task) -> Outcome:
    """Run a task in a fork of this process, and wait for it."""
    folder = tempfile.mkdtemp(prefix="mutant-")
    place = os.memfd_create("answer")  # which has no end that a reader must wait at
    started = time.monotonic()
    pid = os.fork()
    if pid == 0:
        try:
            _child(root, task, folder, place)
        finally:
            os._exit(0)
    try:
        late = not _ends(pid, WAITS * task.limit)
    finally:
        # It, and what its tests have left running.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
        _, status, usage = os.wait4(pid, 0)
        answer = os.pread(place, os.fstat(place).st_size, 0)
        os.close(place)
        shutil.rmtree(folder, ignore_errors=True)
    verdict, by, failed = _verdict(task, status, answer, late)
    cpu = usage.ru_utime + usage.ru_stime
    return Outcome(verdict, by, round(cpu, 2), round(time.monotonic() - started, 2), failed)


def _ends(pid: int, waits: float) -> bool:
    """Wait for the end of a child, and give up when it has waited for some seconds itself."""
    ended = os.pidfd_open(pid)
    poll = select.poll()
    poll.register(ended, select.POLLIN)
    try:
        while not poll.poll(LOOK * 1000):
            waits -= 0.0 if _works(str(pid)) else LOOK
            if waits <= 0:
                return False
        return True
    finally:
        os.close(ended)


def _works(session: str) -> bool:
    """Whether a thread of a session wants to run (R) or waits for a disk (D)."""
    for thread in glob.iglob("/proc/[0-9]*/task/*/stat"):
        with contextlib.suppress(OSError), open(thread) as file:
            fields = file.read().rpartition(")")[2].split()
            if fields[0] in ("R", "D") and fields[3] == session:
                return True
    return False


def _verdict(task: Task, status: int, answer: bytes, late: bool) -> tuple[str, str, Sequence[str]]:
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    if late or (number == signal.SIGXCPU and not answer):
        return "timeout", "", ()
    if not answer:
        return "killed", signal.Signals(number).name if number else "the process ended", ()
    code, failed, missing = json.loads(answer)
    if code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        if missing and not task.file:
            return "missing", missing[0], ()
        return "survived", "", ()
    by = failed[0] if failed else f"pytest ended with {pytest.ExitCode(code).name}"
    return "killed", by, failed


def collected(root: Path, paths: Sequence[str]) -> set[str]:
    """Return the node ids of all tests there are."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.close(read)
            _collect(root, paths, write)
        finally:
            os._exit(0)
    os.close(write)
    with open(read) as file:
        text = file.read()
    os.waitpid(pid, 0)
    return set(text.splitlines())


def _collect(root: Path, paths: Sequence[str], answer: int) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.chdir(root)
    chosen = _All()
    pytest.main(["--collect-only", *OPTIONS, *paths], plugins=[chosen])
    with open(answer, "w") as file:
        file.write("\n".join(chosen.names))


class _All:
    """Plug-in: notes the names of all tests."""

    names: Sequence[str] = ()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self.names = [item.nodeid for item in items]
