"""Build hook: the core, compiled by mypyc into the wheel, where a C compiler is.

Runs when a wheel is built, by hatchling, and never later; it imports nothing of vbus.

========================  ========================================================================
``VBUS_PURE=1``           build the wheel without the compiled core, on any machine
``VBUS_NEED_COMPILED=1``  no compiled core is an error, not a note
``VBUS_RELEASE=1``        compile with ``-O3`` and link-time optimization, minutes longer
``CC``, ``CFLAGS``        the compiler, and options added to ours
========================  ========================================================================

Without a compiler, or without Python's headers, the wheel is pure Python, and it says why in
``vbus doctor``. A type error in the sources stops the build, whether or not a compiler is there.
An editable installation stays interpreted, and says so at the terminal.
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

SAMPLED: Final = (
    "axis.py", "chip.py", "control_loop.py", "cycle.py", "encoder.py", "microstep.py", "output.py",
    "pid.py", "profile.py", "pins.py", "registers.py", "stepper.py", "generated/registers.py",
)  # fmt: skip
"""What works in each sample, or at each edge of a strobe, of any chip's folder."""

SHARED: Final = ("core/bits.py", "core/kernel/*.py", "plant/*.py", "chips/motion/*.py")
"""What works in each sample, whatever the chip."""

CYCLES: Final = (
    "board/card/card_bus.py", "board/card/card_path.py", "board/host_bus.py", "board/host_clock.py",
    "chips/base.py", "circuit/circuit.py", "circuit/host_pins.py", "protocols/base.py",
    "protocols/byte.py", "protocols/port.py", "core/signals/net.py", "core/signals/wire.py",
    "record/recorded_bus.py", "record/rows.py",
)  # fmt: skip
"""What works in each bus cycle, with a journal too."""

COMPILED: Final = (
    *SHARED, *CYCLES,
    "core/signals/*.py", "chips/*.py", "chips/*/*.py", "chips/*/generated/registers.py",
    "protocols/codes.py", "protocols/frames.py", "protocols/text.py", "board/board.py",
    "board/host_*.py", "board/strobe_*.py", "circuit/strobe_player.py",
    "circuit/glue_cycles.py",
    "serve/fast_path.py", "serve/session.py", "serve/time/pacer.py",
    "serve/time/statistics.py",
    "record/again.py", "views/wave/changes.py", "views/wave/vcd_file.py",
    "views/scope/lane.py", "views/scope/axis_sampler.py",
)  # fmt: skip
"""What is compiled, but for :data:`COLD`: what work takes 1.3 times as long without, as
``benchmarks/compiled_modules.py`` measures, and what such modules inherit from or look into."""

COLD: Final = frozenset({
    "__init__.py", "clauses.py", "tables.py", "ac_table.py",
    "family.py", "datasheet.py", "bus.py", "bus_watch.py", "packets.py", "coverage.py", "upsets.py",
    "compatible.py", "host.py", "demo.py", "core/signals/values.py",
    "core/signals/trace_hash.py", "core/signals/violation.py", "plant/fmu.py", "plant/outside.py",
})  # fmt: skip
"""Tables, what reads them once, of a chip's folder all but its behaviour, and what gains little
by being compiled; by the ends of paths."""

FLAGS: Final = (
    # Calls between functions of one library need no detour: a sample takes a fifth less.
    "-fno-semantic-interposition", "-fvisibility=hidden",
    # No multiplication and addition in one: floats are the same on every machine.
    "-ffp-contract=off",
    # C throws nothing: a tenth of the library would be tables for that.
    "-fno-asynchronous-unwind-tables",
)  # fmt: skip

WHOLE: Final = ("-O3", "-flto")
"""Of a release, where the compiler and its linker can: calls from module to module are compiled as
those inside one are. An MCP-1200's sample takes a tenth less, an LM629's a twentieth; the link
takes a minute or two."""

FAST: Final = "-O3"
SOON: Final = "-Og"
"""Of units and of the rest, but in a release: the rest is compiled in half the time of ``-O2``."""

SLOWER: Final = "50 to 170 times slower in samples and some ten times on the bus"
"""What the interpreted core is, beside the compiled one."""

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
        if self.target_name != "wheel":
            return
        if version == "editable":
            announce(f"vbus: an editable installation runs the interpreted core, {SLOWER}")
            return
        # It stays until finalize(): the wheel is packed from it.
        self._scratch = tempfile.mkdtemp(prefix="vbus-build-")
        scratch = Path(self._scratch)
        need = _set("VBUS_NEED_COMPILED")
        include = build_data["force_include"]
        try:
            if _set("VBUS_PURE"):
                raise NoCompiler("it was built with VBUS_PURE set")
            compiler = Compiler(scratch)
            announce(
                f"vbus: compiling the core with {compiler.command[0]}: about a minute on two"
                f" processors; VBUS_PURE=1 does without, {SLOWER}"
            )
            for built, place in compile_core(Path(self.root), scratch, compiler):
                include[str(built)] = place
        except NoCompiler as error:
            # A release must not be slow because a compiler was missing for a minute.
            if need:
                raise SystemExit(
                    f"vbus: no compiled core: {error}. VBUS_NEED_COMPILED makes that an error; "
                    "install gcc and the headers of this Python, or unset it."
                ) from None
            reason = scratch / "reason.txt"
            reason.write_text(f"{error}\n", encoding="utf-8")
            # None of the modules: half a compiled core would be two versions of one class.
            include.clear()
            include[str(reason)] = "vbus/compiled/reason.txt"
            self.app.display_warning(
                f"vbus: the core of this wheel is interpreted, {SLOWER}: {error}"
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
    """Print on the terminal of the build's user: pip does not show what a build prints."""
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
        if not any(path.match(end) for end in COLD)
    }
    return sorted(str(path.relative_to(root)) for path in files)


def units(root: Path) -> list[tuple[str, ...]]:
    """Return which files are compiled as one each, for speed: relative to ``root``.

    What is shared, with mypyc's own library; each chip's folder; bus cycles. Calls between files of
    a unit need no link-time optimization, whose link takes longer than all the rest, and a sample
    takes no longer than with it.
    """
    chips = sorted(path.parent.name for path in (root / "vbus/chips").glob("*/chip.py"))
    patterns = [SHARED, *(tuple(f"chips/{chip}/{file}" for file in SAMPLED) for chip in chips)]
    compiled = core_files(root)
    return [
        tuple(
            file for file in compiled
            if any(Path(file).match(f"vbus/{pattern}") for pattern in unit)
        )
        for unit in (*patterns, CYCLES)
    ]  # fmt: skip


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
        # Another compiler's objects may need its own linker, as for link-time optimization.
        if os.environ.get("CC"):
            self.link_command = [*self.command, "-shared"]
        options = f"{settings.get('CFLAGS', '')} {settings.get('CCSHARED', '')}"
        self.options = [
            *shlex.split(options),
            *(f"-I{folder}" for folder in _header_folders()),
        ]
        self.own = shlex.split(os.environ.get("CFLAGS", ""))
        self.suffix: str = settings["EXT_SUFFIX"]
        # Found now, with a reason, and not after a minute of mypyc.
        self._probe(scratch, [])
        self.whole: tuple[str, ...] = ()
        if _set("VBUS_RELEASE"):
            with contextlib.suppress(NoCompiler):
                self._probe(scratch, [*WHOLE])
                self.whole = WHOLE

    def _probe(self, scratch: Path, options: list[str]) -> None:
        source = scratch / "probe.c"
        source.write_text(PROBE, encoding="utf-8")
        if shutil.which(self.command[0]) is None:
            raise NoCompiler(f"there was no C compiler ({self.command[0]})")
        try:
            self.compile(source, scratch / "probe.o", options)
            self.link([scratch / "probe.o"], scratch / f"probe{self.suffix}", options)
        except NoCompiler as error:
            # The commonest lack: said by the name of the package that brings it.
            if "Python.h" in str(error):
                version = f"{sys.version_info[0]}.{sys.version_info[1]}"
                raise NoCompiler(
                    f"the headers of Python {version} were missing (Python.h: python3-dev)"
                ) from None
            raise

    def compile(self, source: Path, target: Path, options: list[str]) -> None:
        """Compile one C file, or a header, which files that begin with it need not read again."""
        kind = ["-x", "c-header"] if source.suffix == ".h" else []
        self._run([*self.command, *self.options, *options, *self.own,
                   *kind, "-c", str(source), "-o", str(target)])  # fmt: skip

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


def generate(root: Path, scratch: Path) -> list[Any]:
    """Make C of the core by mypyc; return what is to be compiled, as setuptools has it."""
    from mypyc.build import mypycify

    # mypyc finds modules by their paths, from where it stands.
    before = os.getcwd()
    os.chdir(root)
    try:
        made: list[Any] = mypycify(
            [
                "--config-file=",
                f"--cache-dir={scratch / 'cache'}",
                # What these files use may not be there when they are built.
                "--ignore-missing-imports",
                "--follow-imports=silent",
                *core_files(root),
            ],
            debug_level="0",
            multi_file=True,
            target_dir=str(scratch / "c"),
            group_name=GROUP,
        )
    finally:
        os.chdir(before)
    return made


def compile_core(root: Path, scratch: Path, compiler: Compiler) -> list[tuple[Path, str]]:
    """Compile the core; return each extension module with its place in the wheel."""
    extensions = generate(root, scratch)
    jobs: list[tuple[Path, list[str]]] = []
    shims: list[tuple[Path, Path]] = []
    built = []
    for extension in extensions:
        place = extension.name.replace(".", "/") + compiler.suffix
        target = scratch / "lib" / place
        built.append((target, place))
        sources = [Path(root, source) for source in extension.sources]
        if len(sources) == 1:
            # One library has all code, the others only name it.
            shims.append((sources[0], target))
            continue
        library = target
        options = [o for o in extension.extra_compile_args if o != "-Werror" and o[:2] != "-O"]
        options += [*(f"-I{folder}" for folder in extension.include_dirs), *FLAGS]
        # With link-time optimization the linker sees all calls: units gain nothing.
        if not compiler.whole:
            for number, files in enumerate(units(root)):
                unit, sources = _unit(sources, files, scratch / "c" / f"unit{number}.c")
                jobs.append((unit, [*options, FAST]))
        options += compiler.whole or (SOON,)
        options += _header(compiler, scratch / "header", options)
        jobs += [(source, options) for source in sources]
    with ThreadPoolExecutor(os.cpu_count()) as workers:
        # Units, the longest, are the first: none is left alone at the end.
        done = [
            workers.submit(compiler.compile, source, _object(source, scratch), options)
            for source, options in jobs
        ]
        done += [
            workers.submit(compiler.link, [source], target, [*compiler.options, "-O0"])
            for source, target in shims
        ]
        for job in done:
            job.result()
    whole = [o.replace("-flto", f"-flto={os.cpu_count()}") for o in compiler.whole]
    compiler.link([_object(source, scratch) for source, _ in jobs], library, whole)
    return built


def _unit(sources: list[Path], files: tuple[str, ...], unit: Path) -> tuple[Path, list[Path]]:
    """Write a C file that stands for those of some modules; return it, and the others."""
    stems = {"___".join(("__native_vbus", *Path(f).with_suffix("").parts[1:])) for f in files}
    taken = [source for source in sources if source.stem in stems]
    if "vbus/core/bits.py" in files:
        # What mypyc brings: conversions and divisions of each sample are among it.
        taken += [source for source in sources if not source.stem.startswith("__native")]
    unit.write_text("".join(f'#include "{source.name}"\n' for source in taken))
    return unit, [source for source in sources if source not in taken]


def _header(compiler: Compiler, folder: Path, options: list[str]) -> list[str]:
    """Compile what all files of the library read first; return the option that takes it."""
    folder.mkdir()
    header = folder / "all.h"
    names = (f"__native_{GROUP}.h", f"__native_internal_{GROUP}.h")
    header.write_text("".join(f'#include "{name}"\n' for name in names))
    try:
        compiler.compile(header, header.with_name("all.h.gch"), options)
    # A compiler without precompiled headers takes longer, no more.
    except NoCompiler:
        return []
    return ["-include", str(header)]


def _object(source: Path, scratch: Path) -> Path:
    """Where the object of a C file goes: beside it, or, from elsewhere, into the scratch folder."""
    if source.is_relative_to(scratch):
        return source.with_suffix(".o")
    return scratch / f"{source.stem}.o"
