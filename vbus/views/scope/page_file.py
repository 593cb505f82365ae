"""The page: its files as they are served, and all of them in one file with a recording."""

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Any, Final

from vbus.core.errors import VbusError

PAGE: Final = files("vbus.views.scope") / "page"
FIRST: Final = "index.html"

LONGEST: Final = 100
"""Characters of a name that a message shows."""
_FILE: Final = re.compile(r"[\w-]+\.(js|css|html)")
_STYLE: Final = re.compile(r'<link\b[^>]*\bhref="/?(?:page/)?([\w-]+\.css)"[^>]*>')
_SCRIPT: Final = re.compile(r'<script\b[^>]*\bsrc="/?(?:page/)?([\w-]+\.js)"[^>]*>\s*</script>')
_HEAD: Final = re.compile(r"<head[^>]*>")
_IMPORT: Final = re.compile(r'^import\s*\{[^}]*\}\s*from\s*"\./([\w-]+\.js)";\n?', re.MULTILINE)
_EXPORT: Final = re.compile(
    r"^export (?=(?:async |)(?:class|const|function\*?|let) (\w+))", re.MULTILINE
)


def page_file(name: str) -> str:
    """Return the text of a file of the page.

    Raises:
        VbusError: there is none of that name.
    """
    # Names that are there, not a path: nothing leads out of the folder.
    there = {file.name: file for file in PAGE.iterdir() if _FILE.fullmatch(file.name)}
    if name not in there:
        raise VbusError(f"the page has no file {name[:LONGEST]}")
    return there[name].read_text(encoding="utf-8")


def policy(scripts: str, styles: str, connect: str) -> str:
    """Return what a browser is allowed on the page; nothing is from elsewhere."""
    return (
        f"default-src 'none'; script-src {scripts}; style-src {styles}; connect-src {connect};"
        " img-src data: blob:; base-uri 'none'; form-action 'none'"
    )


def one_file(description: dict[str, Any], frames: Sequence[bytes]) -> bytes:
    """Return the page with a recording in it: it needs nothing else, and no network.

    Args:
        description: the description that comes before the first frame.
        frames: the recording.
    """
    styles: list[str] = []
    scripts: list[str] = []

    def style(match: re.Match[str]) -> str:
        styles.append(page_file(match[1]))
        return f"<style>{styles[-1]}</style>"

    def script(match: re.Match[str]) -> str:
        scripts.append(joined(match[1]))
        # It stands in a script element: no end of one may be in it.
        # "</script" in a title would end the element.
        text = json.dumps(description, ensure_ascii=False).replace("<", "\\u003c")
        return (
            f'<script type="application/json" id="description">{text}</script>\n'
            f'<script type="application/octet-stream" id="recording">{_packed(frames)}</script>\n'
            f'<script type="module">{scripts[-1]}</script>'
        )

    page = _STYLE.sub(style, page_file(FIRST))
    page = _SCRIPT.sub(script, page)
    allowed = policy(_hashes(scripts), _hashes(styles), "'none'")
    meta = f'<meta http-equiv="Content-Security-Policy" content="{allowed}">'
    return _HEAD.sub(lambda match: f"{match[0]}\n{meta}", page, count=1).encode()


def _packed(frames: Sequence[bytes]) -> str:
    # Raw, without the head of zlib: the page unpacks deflate-raw.
    # The file is made once and read often: the slowest level.
    deflate = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    data = b"".join([deflate.compress(frame) for frame in frames]) + deflate.flush()
    return base64.b64encode(data).decode("ascii")


def _hashes(texts: Sequence[str]) -> str:
    found = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts]
    return " ".join(f"'sha256-{each}'" for each in found) or "'none'"


def joined(name: str) -> str:
    """Return a module and all it imports as one: what each imports stands above it.

    Each is a function of its own, which gives what the module exports; no two export one name.

    Raises:
        VbusError: modules import each other in a circle.
    """
    order = dict.fromkeys(_needed(name, ()))
    return "\n".join(map(_enclosed, order)).replace("</script", "<\\/script")


def _enclosed(name: str) -> str:
    text = _IMPORT.sub("", page_file(name))
    names = ", ".join(_EXPORT.findall(text))
    return f"const {{ {names} }} = (() => {{\n{_EXPORT.sub('', text)}return {{ {names} }};\n}})();"


def _needed(name: str, above: tuple[str, ...]) -> Iterator[str]:
    """Give the modules that one needs, each after those it needs itself."""
    if name in above:
        raise VbusError(f"modules of the page import each other: {' -> '.join([*above, name])}")
    for match in _IMPORT.finditer(page_file(name)):
        yield from _needed(match[1], (*above, name))
    yield name
