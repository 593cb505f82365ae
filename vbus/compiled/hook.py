"""Build hook: the core, compiled by mypyc into the wheel, where a C compiler is.

Runs when a wheel is built, by hatchling, and never later; it imports nothing of vbus.

========================  ========================================================================
``VBUS_PURE=1``           build the wheel without the compiled core, on any machine
``VBUS_NEED_COMPILED=1``  no compiled core is an error, not a note
``CC``, ``CFLAGS``        the compiler, and options added to ours
========================  ========================================================================

Without a compiler, or without Python's headers, the wheel is pure Python, and it says why in
``vbus doctor``. A type error in the sources stops the build, whether or not a compiler is there.
An editable installation stays interpreted.
"""

import contextlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

COMPILED: Final = (
    "bits.py", "state/fields.py", "state/kinds.py", "kernel/*.py", "signals/*.py",
    "chips/*.py", "chips/*/*.py", "chips/*/generated/registers.py", "plant/*.py",
    "protocols/base.py", "protocols/byte.py", "protocols/codes.py", "protocols/frame*.py",
    "protocols/port.py", "protocols/text.py", "board/board.py", "circuit/circuit.py",
    "board/host_*.py", "board/strobe_*.py", "circuit/host_pins.py", "circuit/strobe_player.py",
    "board/card_bus.py", "board/card_path.py",
    "board/card_cycle.py", "board/card_edges.py", "circuit/glue_cycles.py",
    "server/direct.py", "server/pace.py", "server/pacer.py", "server/patience.py",
    "server/session.py", "server/statistics.py", "server/ticks.py", "server/turns.py",
    "trace/journal/again.py", "trace/journal/rows.py",
    "trace/journal/recorded_bus.py", "trace/wave/changes.py", "trace/wave/vcd_file.py",
    "scope/lane.py", "scope/look.py",
)  # fmt: skip
"""What is compiled, but for :data:`COLD`: what works in every sample, bus cycle or message."""

COLD: Final = frozenset({
    "__init__.py", "clauses.py", "tables.py",
    "family.py", "datasheet.py", "bus.py", "bus_watch.py", "packets.py", "coverage.py", "upsets.py",
    "compatible.py", "inner_registers.py",
    "access.py", "host.py", "demo.py",
})  # fmt: skip
"""Tables, what reads them once, and of a chip's folder all but its behaviour; by names of files."""

OPTIMIZE: Final = "3"
"""-O2 takes a sample of an MCP-1200 a sixteenth longer, one of an MC1241A a twentieth."""

FLAGS: Final = (
    # Calls between functions of one library need no detour: a sample takes a fifth less.
    "-fno-semantic-interposition", "-fvisibility=hidden",
    # No multiplication and addition in one: floats are the same on every machine.
    "-ffp-contract=off",
)  # fmt: skip

WHOLE: Final = "-flto"
"""Calls from module to module are compiled as those inside one are: an MCP-1200's sample takes a
tenth less, an LM629's a twentieth. Where the compiler and its linker can."""

GROUP: Final = "vbus"
"""Name of the library all modules are in: ``vbus__mypyc``."""

PROBE: Final = "#include <Python.h>\nint probe(void) { return PY_VERSION_HEX != 0; }\n"


class NoCompiler(Exception):
    """The machine cannot compile; the text says why."""


class CompiledCore(BuildHookInterface):
    """The hook hatchling calls."""

    PLUGIN_NAME = "vbus-compiled-core"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the compiled core to the wheel, or the reason why there is none."""
        if self.target_name != "wheel" or version == "editable":
            return
        self._scratch = tempfile.mkdtemp(prefix="vbus-build-")
        scratch = Path(self._scratch)
        need = _set("VBUS_NEED_COMPILED")
        include = build_data["force_include"]
        try:
            if _set("VBUS_PURE"):
                raise NoCompiler("it was built with VBUS_PURE set")
            compiler = Compiler(scratch)
            announce(
                f"vbus: compiling the core with {compiler.command[0]}, a minute or two;"
                " VBUS_PURE=1 does without, some ten times slower"
            )
            for built, place in compile_core(Path(self.root), scratch, compiler):
                include[str(built)] = place
        except NoCompiler as error:
            if need:
                raise SystemExit(
                    f"vbus: no compiled core: {error}. VBUS_NEED_COMPILED makes that an error; "
                    "install gcc and the headers of this Python, or unset it."
                ) from None
            reason = scratch / "reason.txt"
            reason.write_text(f"{error}\n", encoding="utf-8")
            include.clear()
            include[str(reason)] = "vbus/compiled/reason.txt"
            self.app.display_warning(
                f"vbus: the core of this wheel is interpreted, some ten times slower: {error}"
            )
        else:
            build_data["pure_python"] = False
            build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was made on the way."""
        scratch = getattr(self, "_scratch", "")
        if scratch:
            shutil.rmtree(scratch, ignore_errors=True)


def announce(sentence: str) -> None:
    """Tell whoever waits at the terminal: what a build prints, pip keeps to itself."""
    with contextlib.suppress(OSError), open("/dev/tty", "w", encoding="utf-8") as terminal:
        terminal.write(f"\n{sentence}\n")


def _set(name: str) -> bool:
    return os.environ.get(name, "") not in ("", "0")


def core_files(root: Path) -> list[str]:
    """Return the files of the core that are compiled, relative to ``root``."""
    files = {
        path
        for pattern in COMPILED
        for path in (root / "vbus").glob(pattern)
        if path.name not in COLD
    }
    return sorted(str(path.relative_to(root)) for path in files)


class Compiler:
    """The C compiler Python itself was made for, or ``CC``.

    Raises:
        NoCompiler: there is none, or it cannot make an extension module.
    """

    def __init__(self, scratch: Path) -> None:
        if sys.implementation.name != "cpython":
            raise NoCompiler(f"{sys.implementation.name} runs compiled extensions no faster")
        settings = sysconfig.get_config_vars()
        self.command = shlex.split(os.environ.get("CC") or settings.get("CC") or "cc")
        self.link_command = shlex.split(settings.get("LDSHARED") or "cc -shared")
        if os.environ.get("CC"):
            self.link_command = [*self.command, "-shared"]
        options = f"{settings.get('CFLAGS', '')} {settings.get('CCSHARED', '')}"
        self.options = [
            *shlex.split(options),
            *(f"-I{folder}" for folder in _header_folders()),
        ]
        self.own = shlex.split(os.environ.get("CFLAGS", ""))
        self.suffix: str = settings["EXT_SUFFIX"]
        self._probe(scratch, [])
        self.whole: list[str] = []
        with contextlib.suppress(NoCompiler):
            self._probe(scratch, [WHOLE])
            self.whole = [WHOLE]

    def _probe(self, scratch: Path, options: list[str]) -> None:
        source = scratch / "probe.c"
        source.write_text(PROBE, encoding="utf-8")
        if shutil.which(self.command[0]) is None:
            raise NoCompiler(f"there was no C compiler ({self.command[0]})")
        try:
            self.compile(source, scratch / "probe.o", options)
            self.link([scratch / "probe.o"], scratch / f"probe{self.suffix}", options)
        except NoCompiler as error:
            if "Python.h" in str(error):
                version = f"{sys.version_info[0]}.{sys.version_info[1]}"
                raise NoCompiler(
                    f"the headers of Python {version} were missing (Python.h: python3-dev)"
                ) from None
            raise

    def compile(self, source: Path, target: Path, options: list[str]) -> None:
        """Compile one C file."""
        self._run([*self.command, *self.options, *options, *self.own,
                   "-c", str(source), "-o", str(target)])  # fmt: skip

    def link(self, objects: list[Path], target: Path, options: list[str]) -> None:
        """Link objects to an extension module."""
        target.parent.mkdir(parents=True, exist_ok=True)
        self._run([*self.link_command, "-s", *options, *map(str, objects), "-o", str(target)])

    def _run(self, command: list[str]) -> None:
        try:
            subprocess.run(command, check=True, capture_output=True, text=True)
        except OSError as error:
            raise NoCompiler(f"{command[0]} could not be run: {error.strerror}") from None
        except subprocess.CalledProcessError as error:
            lines = [line for line in error.stderr.splitlines() if "error" in line]
            raise NoCompiler(
                f"{command[0]} failed: {(lines or [f'exit code {error.returncode}'])[0]}"
            ) from None


def _header_folders() -> list[str]:
    paths = sysconfig.get_paths()
    return sorted({paths["include"], paths["platinclude"]})


def compile_core(root: Path, scratch: Path, compiler: Compiler) -> list[tuple[Path, str]]:
    """Compile the core; return each extension module with its place in the wheel."""
    from mypyc.build import mypycify

    # mypyc finds modules by their paths, from where it stands.
    before = os.getcwd()
    os.chdir(root)
    try:
        extensions = mypycify(
            [
                "--config-file=",
                f"--cache-dir={scratch / 'cache'}",
                # What these files use may not be there when they are built.
                "--ignore-missing-imports",
                "--follow-imports=silent",
                *core_files(root),
            ],
            opt_level=OPTIMIZE,
            debug_level="0",
            multi_file=True,
            target_dir=str(scratch / "c"),
            group_name=GROUP,
        )
    finally:
        os.chdir(before)
    jobs = []
    links = []
    for extension in extensions:
        # One library has all code, the others only name it.
        whole = compiler.whole if len(extension.sources) > 1 else []
        options = [option for option in extension.extra_compile_args if option != "-Werror"]
        options += [*(f"-I{folder}" for folder in extension.include_dirs), *FLAGS, *whole]
        jobs += [(Path(root, source), options) for source in extension.sources]
        links.append((extension, [f"{option}={os.cpu_count()}" for option in whole]))
    # The longest first, so that none is left alone at the end.
    jobs.sort(key=lambda job: job[0].stat().st_size, reverse=True)
    with ThreadPoolExecutor(os.cpu_count()) as workers:
        done = [
            workers.submit(compiler.compile, source, _object(source, scratch), options)
            for source, options in jobs
        ]
        for job in done:
            job.result()
    built = []
    for extension, options in links:
        place = extension.name.replace(".", "/") + compiler.suffix
        objects = [_object(Path(root, source), scratch) for source in extension.sources]
        compiler.link(objects, scratch / "lib" / place, options)
        built.append((scratch / "lib" / place, place))
    return built


def _object(source: Path, scratch: Path) -> Path:
    """Where the object of a C file goes: beside it, or, from elsewhere, into the scratch folder."""
    if source.is_relative_to(scratch):
        return source.with_suffix(".o")
    return scratch / f"{source.stem}.o"
