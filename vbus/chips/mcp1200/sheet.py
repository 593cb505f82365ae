"""Between the core and the register bytes: decoding them and writing them only when it matters."""

from typing import ClassVar

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.picture import Live, Picture
from vbus.chips.mcp1200.shown import Shown
from vbus.chips.registers import RegisterFile
from vbus.state import Names


class Sheet:
    """The registers as the core works with them.

    From sample to sample everything stays in words: results reach the register bytes, and the
    bytes are decoded anew, only when :meth:`settle` says that somebody else comes.

    Args:
        file: the registers.

    Attributes:
        live: registers that count at once.
        picture: what the sample under way computes from.
        shown: what samples have written until now.
        stale: bytes may have changed that are in the picture.
    """

    __slots__ = (
        "_before", "_dirty", "_image", "_known", "_taken", "bytes", "file", "live", "picture",
        "shown", "stale",
    )  # fmt: skip
    STATE: ClassVar[Names] = ("image: bytes",)
    WIRING: ClassVar[Names] = ("bytes", "file", "live", "picture", "shown")
    DERIVED: ClassVar[Names] = ("_before", "_dirty", "_image", "_known", "_taken", "stale")

    def __init__(self, file: RegisterFile) -> None:
        self.file: RegisterFile = file
        self.bytes: bytearray = file.bytes
        self.live: Live = Live(file.bytes)
        self.picture: Picture = Picture()
        self.shown: Shown = Shown()
        self.stale: bool = True
        # Whether what is shown is what the bytes say, or newer; and whether it is newer.
        self._known: bool = False
        self._dirty: bool = False
        # The bytes the picture was decoded from. Those of the last sample's start, but for what
        # samples had shown by then; and that.
        self._taken: bytes = bytes(len(self.bytes))
        self._image: bytes = self._taken
        self._before: Shown = Shown()

    def settle(self) -> None:
        """Bring the register bytes up to date, and do not trust them to stay as they are."""
        if self._dirty:
            self.shown.store(self.bytes)
            self._dirty = False
        self._known = False
        self.stale = True

    def write_on(self) -> None:
        """What is shown is going to change."""
        if not self._known:
            self.shown.load(bytes(self.bytes))
            self._known = True
        self._dirty = True

    def take_picture(self) -> None:
        """The registers as they are now are what a sample computes from."""
        shown = self.shown
        picture = self.picture
        if self.stale:
            if self._dirty:
                shown.store(self.bytes)
            self._taken = bytes(self.bytes)
            picture.take(self._taken)
            self.stale = False
        self.write_on()
        picture.flag = shown.flag
        picture.capture = shown.capture
        picture.command = shown.command

    def keep(self) -> None:
        """The sample that has taken the picture begins."""
        self._image = self._taken
        self._before.copy(self.shown)

    def fault(self, flag: int) -> None:
        """An active-low error flag becomes 0; the direction of motion is noted (MCP-STA-3)."""
        self.write_on()
        self.shown.fault(flag)
        self.settle()

    def outputs_off(self) -> None:
        """Both motor command outputs to zero."""
        self.settle()
        self.bytes[ds.MOTOR_COMMAND] = 0x80
        self.bytes[ds.MOTOR_COMMAND_LOW] = 0
        self.bytes[ds.PWM_COMMAND] = 0
        self.bytes[ds.PWM_FRACTION] = 0
        self.live.look()

    @property
    def image(self) -> bytes:
        """The registers as they were when the last sample began."""
        image = bytearray(self._image)
        self._before.store(image)
        return bytes(image)

    @image.setter
    def image(self, image: bytes) -> None:
        self._image = image
        self._before.load(image)
        self.picture.take(image)
        self._known = False
        self._dirty = False
        self.stale = True
