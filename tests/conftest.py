"""Coverage of clauses: says which have no test, and fails the run when one that should has none."""

import gc
import os
import signal
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

import vbus
from tests import costs, left_out, left_running, repeat
from tests.clauses import Clause, read_clauses, stale, unknown, untested
from tests.waiting import PATIENCE
from vbus.client import aio, connect
from vbus.compiled import core, is_compiled, why
from vbus.serve import registry

# A run repeats, on every machine. HYPOTHESIS_PROFILE=search looks for examples nobody has seen.
# How long it takes to make them is not judged: a busy machine takes long.
CALM: dict[str, Any] = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("repeatable", derandomize=True, **CALM)
settings.register_profile("search", max_examples=2000, **CALM)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))
# It draws numbers of the project's modules, too: of those that are imported by then, which hangs on
# the tests before, and so on the worker.
providers._get_local_constants = providers.Constants

QUICK = {"conformance", "frozen", "test_architecture.py", "unit"}
CLAUSES: pytest.StashKey[dict[str, Clause]] = pytest.StashKey()
MARKED: pytest.StashKey[set[str]] = pytest.StashKey()


@pytest.hookimpl(trylast=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Say which core the tests run on; with -q, too, which leaves out the lines of the header."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None:
        where = next(iter(vbus.__path__))
        reporter.write_line(f"vbus {vbus.__version__}: {core()} core, from {where}")


def pytest_configure(config: pytest.Config) -> None:
    gc.disable()  # all that is collected stays: looking for garbage took a fifth of the time
    if os.environ.get("VBUS_NEED_COMPILED", "") not in ("", "0") and not is_compiled():
        raise pytest.UsageError(f"VBUS_NEED_COMPILED is set, and the core is interpreted: {why()}")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # A background job of a shell: the programs under test would not hear Ctrl-C either.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # The 5 s of a host that says nothing are too few where the machine is busy, and the 2 s in
    # which a board tells of itself.
    registry.ANSWER_SECONDS = PATIENCE  # type: ignore[misc]
    for connects in (connect, aio.connect):
        connects.__defaults__ = (PATIENCE, *connects.__defaults__[1:])
    config.pluginmanager.register(repeat)
    config.pluginmanager.register(left_out)
    config.pluginmanager.register(left_running)
    config.pluginmanager.register(costs)
    config.stash[CLAUSES] = read_clauses(Path(__file__).parents[1] / "vbus" / "chips")
    config.stash[MARKED] = set()
    if config.pluginmanager.hasplugin("xdist"):
        config.pluginmanager.register(_Workers())
        config.option.loadscopereorder = False  # it would have files of few and long tests last


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        for mark in item.iter_markers("spec"):
            config.stash[MARKED].update(mark.args)
    items.sort(key=lambda item: _quick(item.path))


def pytest_collection_finish() -> None:
    """Look for garbage of tests alone: with 12,000 tests in it the heap took 8 % of their time."""
    gc.freeze()
    gc.enable()


@cache
def _quick(file: Path) -> bool:
    """Whether a file takes seconds at most: such files come last, so that no worker waits long."""
    folders = file.relative_to(Path(__file__).parent).parts
    return folders[0] in QUICK and folders[:2] != ("unit", "testing")


def _whole(config: pytest.Config) -> bool:
    """Whether the whole suite was asked for: no path, -k, -m or other choice of tests."""
    option = config.option
    chosen = ("keyword", "markexpr", "deselect", "ignore", "ignore_glob", "lf", "stepwise")
    if any(getattr(option, name, None) for name in chosen):
        return False
    return config.args_source is not pytest.Config.ArgsSource.ARGS or [
        Path(arg).resolve() for arg in config.args
    ] in ([Path(__file__).parent], [config.rootpath])


class _Workers:
    """Of pytest-xdist: the tests were collected there, so the clauses they mark come from there."""

    def pytest_testnodedown(self, node: Any) -> None:
        node.config.stash[MARKED].update(getattr(node, "workeroutput", {}).get("clauses", ()))


def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    if (output := getattr(config, "workeroutput", None)) is not None:
        output["clauses"] = sorted(config.stash[MARKED])
        return
    if session.exitstatus == pytest.ExitCode.OK and _problems(config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _problems(config: pytest.Config) -> list[str]:
    clauses, marked = config.stash[CLAUSES], config.stash[MARKED]
    whole = _whole(config)
    lines = [f"{name}: a test names it, no list has it" for name in unknown(clauses, marked, whole)]
    lines += [f"{c.name}: listed as open, but a test names it" for c in stale(clauses, marked)]
    if whole:
        lines += [f"{c.name}: no test ({c.title})" for c in untested(clauses, marked)]
    return lines


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    problems = _problems(config)
    clauses = config.stash[CLAUSES]
    if not problems and not _whole(config):
        return
    terminalreporter.section("clauses")
    for line in problems:
        terminalreporter.line(line)
    for clause in clauses.values():
        if not clause.tested:
            terminalreporter.line(f"{clause.name}: open, {clause.title}: {clause.reason}")
    to_test = sum(clause.tested for clause in clauses.values())
    tested = to_test - len(untested(clauses, config.stash[MARKED]))
    terminalreporter.line(
        f"{tested} of {len(clauses)} clauses tested, {len(clauses) - to_test} open"
    )
