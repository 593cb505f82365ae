"""Pictures with matplotlib: the same data gives the same bytes."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vbus.core.errors import PluginError, VbusError
from vbus.serve.output_file import write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_METADATA: Final[dict[str, dict[str, Any]]] = {
    ".svg": {"Date": None}, ".png": {}, ".pdf": {"CreationDate": None},
}  # fmt: skip
"""By the end of a file's name: what is said in it of its making."""

_STYLE: Final = {
    "svg.hashsalt": "vbus", "svg.fonttype": "none", "font.size": 9.0, "axes.grid": True,
    "axes.axisbelow": True, "grid.color": "#e4e4e4", "axes.edgecolor": "#444444",
    "legend.frameon": False, "lines.linewidth": 1.2, "savefig.dpi": 120,
    "axes.formatter.useoffset": False,
}  # fmt: skip
"""What all pictures have, whatever a user has set for his own."""


@contextmanager
def picture(path: Path, width: float, height: float) -> Iterator["Figure"]:
    """Give a figure to draw in, and write it to a file at the end.

    Args:
        path: its name ends in ``.svg``, ``.png`` or ``.pdf``.
        width: in inches.
        height: in inches.

    Raises:
        VbusError: the name ends otherwise, or the file cannot be written.
        PluginError: matplotlib is not installed.
    """
    kind = path.suffix.lower()
    if kind not in _METADATA:
        raise VbusError(f"{path}: a picture's name ends in {', '.join(_METADATA)}")
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError:
        raise PluginError(
            "pictures need matplotlib; install it with: pip install matplotlib"
        ) from None
    drawn = io.BytesIO()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        figure.savefig(drawn, format=kind[1:], metadata=_METADATA[kind])
    write_file(path, drawn.getvalue())
