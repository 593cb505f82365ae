"""A wrapper of g++ (``-wrapper``) that hands the compiler sources for CCS or C18 as C++.

Device headers become the shim's. For CCS the directives that no other compiler knows, the widths of
types and the case of letters are translated too; messages and gdb show the lines of the source.
It runs without ``vbus``: the compiler starts it by its path.
"""

import itertools
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

_DEVICES = {
    "c18": (r"p18\w*\.h", "<p18cxxx.h>"),
    "ccs": (r"(?:1[0-8]|24|3[03])\w*\.h", "<vbus_ccs.h>"),
}
_DONE = "\x01"
"""Stands around what this module writes, and what is not translated again."""

_ATOM = re.compile(
    r'\x01[^\x01]*\x01|//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|'
    r"'(?:\\.|[^'\\\n])*'|^[ \t]*#[ \t]*include[^\n]*",
    re.DOTALL | re.MULTILINE,
)
_TYPE = re.compile(
    r"\b(?:(signed|unsigned)\s+)?"
    r"(?:(int(?:1|8|16|32)?|char)|(short)(?:\s+int)?|(long\s+long)(?:\s+int)?|(long)(?:\s+int)?)\b"
)
_WIDTHS = {"int": 8, "int1": 1, "int8": 8, "int16": 16, "int32": 32, "char": 8}
_IGNORED = re.compile(
    "fuses|device|opt|zero_ram|ignore_warnings|inline|separate|list|nolist|id|priority|reserve|case"
    "|nocase|hexcomment"
)
_PLAIN = re.compile("include|define|undef|if|ifn?def|elif|else|endif|error|warning|pragma|line")
_FIRST = (("PORT", 0xF80), ("LAT", 0xF89), ("TRIS", 0xF92), ("PORT", 5), ("TRIS", 0x85))
# Addresses of a PIC18's seven ports, and of a PIC16's five.
_REGISTERS = {
    number: f"{name}{port}"
    for name, first in _FIRST
    for number, port in enumerate("ABCDEFG"[: 5 if first < 0x100 else 7], first)
}


def _refused(what: str, why: str = "is not there for sources compiled for the PC") -> str:
    return f"{_DONE}#error #{what} {why}{_DONE}"


def _use(text: str, line: int) -> str:
    name, _, rest = (part.strip() for part in text.partition("("))
    argument = rest.partition(")")[0].lower()
    if name == "delay":
        found = re.search(r"(\d[\d,]*)\s*([km]?)", argument)
        if found is not None:
            hertz = int(found[1].replace(",", "")) * {"": 1, "k": 1000, "m": 10**6}[found[2]]
            # A name for each line: a header may be included by several sources.
            clock = f"vbus_clock_{line} __attribute__((unused)) = vbus_ccs_clock({hertz})"
            return f"namespace {{ const bool {clock}; }}"
    elif name in ("fast_io", "standard_io") and re.fullmatch("[a-g]", argument):
        # A macro: with fast_io no access sets the direction, from this line on.
        fast = f"vbus_fast_{argument}"
        return f"\n#undef {fast}\n#define {fast} {int(name == 'fast_io')}\n#line {line + 1}"
    # The console of the PC takes its place.
    elif name == "rs232":
        return ""
    return _refused(f"use {name}")


def _named(kind: str, text: str) -> str:
    """Name a port's register: ``#byte NAME = ADDRESS``, ``#bit NAME = ADDRESS.BIT``."""
    found = re.fullmatch(r"(\w+)\s*=\s*(\w+)(?:\.(\d))?\s*(?://.*|/\*.*)?", text.strip())
    if found is not None and (found[3] is not None) == (kind == "bit"):
        where = found[2]
        # A register's name is the device header's: the shim has it in capitals.
        number = int(where, 0) if re.fullmatch(r"0x[0-9a-fA-F]+|[1-9]\d*", where) else -1
        register = _REGISTERS.get(number, where.upper() if number < 0 else "")
        if register and kind == "byte":
            return f"{_DONE}static vbus_shim::Register &{found[1].lower()} = {register};{_DONE}"
        if register:
            bit = f"vbus_shim::RegisterBit<{register}, {found[3]}>"
            return f"{_DONE}static {bit} {found[1].lower()} __attribute__((unused));{_DONE}"
    return _refused(f"{kind} {text.strip()}", "is not a port's register")


class Translator:
    """Translates a source and the files that it includes in quotes.

    Args:
        dialect: ``"ccs"`` or ``"c18"``.
        folder: where what is translated goes.
        searched: folders in which included files are looked for, after the file's own.
    """

    def __init__(self, dialect: str, folder: Path, searched: list[Path]) -> None:
        self._dialect = dialect
        self._folder = folder
        self._searched = searched
        self._made: dict[Path, Path] = {}

    def file(self, source: Path) -> Path:
        """Return where the translation of ``source`` is; each file is translated once."""
        made = self._made.get(source)
        if made is None:
            made = self._folder / f"{len(self._made)}{source.suffix}"
            self._made[source] = made
            text = source.read_text(encoding="latin-1")
            lines = [self._line(row, number, source.parent)
                     for number, row in enumerate(text.splitlines(), 1)]  # fmt: skip
            body = "\n".join(lines) + "\n"
            # C18 tells letters apart, and has the widths of the shim's types.
            if self._dialect == "ccs":
                body = _folded(body)
            made.write_text(f'#line 1 "{source}"\n{body}', encoding="latin-1")
        return made

    def _line(self, row: str, number: int, here: Path) -> str:
        found = re.match(r"\s*#\s*(\w+)(.*)", row)
        if found is None:
            return row
        name, rest = found[1].lower(), found[2]
        if name == "include":
            return self._include(row, rest.strip(), here)
        if self._dialect != "ccs" or _PLAIN.fullmatch(name):
            return row
        if name in ("byte", "bit"):
            return _named(name, rest)
        if name == "use":
            return _use(rest.strip().lower(), number)
        # What only the device's programmer or linker heeds is left out; any other directive changes
        # code.
        return "" if _IGNORED.fullmatch(name) else _refused(name)

    def _include(self, row: str, what: str, here: Path) -> str:
        device, header = _DEVICES[self._dialect]
        if re.match(rf'[<"]{device}[>"]', what, re.IGNORECASE):
            return f"#include {header}"
        quoted = re.match(r'"([^"]+)"', what)
        for folder in [here, *self._searched] if quoted else []:
            if quoted and (folder / quoted[1]).is_file():
                return f'#include "{self.file((folder / quoted[1]).resolve())}"'
        return row


def _type(found: re.Match[str]) -> str:
    sign, plain, short, long_long, _ = found.groups()
    width = 1 if short else 32 if long_long else _WIDTHS[plain] if plain else 16
    if width == 1:
        return "vbus_int1"
    # Texts are of char: a width of its own would not fit the library.
    if plain == "char" and sign is None:
        return "char"
    # Plain types of CCS are unsigned.
    return f"{'' if sign == 'signed' else 'u'}int{width}_t"


_RENAMED = re.compile(r"\b(printf|putc|putchar|getc|getch|getchar|puts)\b(?=\s*\()")
_NAMES = {"putchar": "putc", "getch": "getc", "getchar": "getc"}


def _code(text: str) -> str:
    return _RENAMED.sub(
        lambda found: f"vbus_{_NAMES.get(found[1], found[1])}", _TYPE.sub(_type, text.lower())
    )


def _folded(text: str) -> str:
    """Fold the case of letters and give types their widths, but in texts and comments."""
    done, place = [], 0
    for atom in _ATOM.finditer(text):
        # Texts and comments stay as they are between the parts that are folded.
        done += [_code(text[place : atom.start()]), atom[0].strip(_DONE)]
        place = atom.end()
    return "".join([*done, _code(text[place:])])


def main(dialect: str, command: list[str]) -> int:
    """Run a subcommand of g++ on translated sources; return its exit code."""
    ours = Path(__file__).parent.resolve()
    searched = [Path(word[2:]) for word in command if word.startswith("-I") and len(word) > 2]
    searched += [Path(word) for before, word in itertools.pairwise(command) if before == "-I"]
    # The shim's own headers are C++ already.
    searched = [folder for folder in searched if not folder.resolve().is_relative_to(ours)]
    with tempfile.TemporaryDirectory(prefix="vbus-") as folder:
        translator = Translator(dialect, Path(folder), searched)
        for place, word in enumerate(command):
            source = Path(word)
            # Sources of the compiler proper: not names of outputs, and not the shim's files.
            if (
                "cc1" in Path(command[0]).name
                and source.suffix in (".c", ".h", ".cpp")
                and not command[place - 1].startswith(("-dumpbase", "-o", "-include", "-M"))
                and source.is_file()
                and not source.resolve().is_relative_to(ours)
            ):
                command[place] = str(translator.file(source.resolve()))
        return subprocess.run(command).returncode


if __name__ == "__main__":
    os.environ.pop("PYTHONSAFEPATH", None)
    sys.exit(main(sys.argv[1], sys.argv[2:]))
