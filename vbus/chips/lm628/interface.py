"""What the pins of an LM628 ask of the chip behind them."""

from vbus.chips.base import Chip


class FrontEndHost(Chip):
    """What the front-ends ask of their chip, beyond what every chip answers."""

    @property
    def powered(self) -> bool:
        """Whether supply is up."""
        raise NotImplementedError

    def index_seen(self, count: int) -> None:
        """The index has come at encoder ``count``; if armed, store its position (LM-POS-3)."""
        raise NotImplementedError

    def read_byte(self) -> int:
        """Return what D0-D7 show in the read under way."""
        raise NotImplementedError

    def expect(self, when: int) -> None:
        """The front-end has something to do at instant ``when``."""
        raise NotImplementedError
