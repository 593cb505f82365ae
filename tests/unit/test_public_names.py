"""The names a program imports from vbus, and what importing it costs."""

import subprocess
import sys

import pytest

import vbus
from vbus.compiled import is_compiled


@pytest.mark.parametrize("name", vbus.__all__)
def test_a_public_name_is_there_with_a_docstring(name: str) -> None:
    # mypyc keeps the docstrings of methods, and drops those of classes.
    assert getattr(vbus, name).__doc__ or is_compiled()
    assert name in dir(vbus)


def test_another_name_is_not() -> None:
    with pytest.raises(AttributeError, match=r"^module 'vbus' has no attribute 'sarve'$"):
        vbus.sarve  # noqa: B018


def test_importing_vbus_and_its_command_line_imports_nothing_heavy() -> None:
    code = (
        "import sys; import vbus.cli.cli;"
        "print(*{'asyncio', 'msgspec', 'msgpack', 'rich', 'serial', 'zenoh', 'vbus.board'}"
        " & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
