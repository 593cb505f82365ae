"""What to do with findings about a host that breaks the datasheet."""

from typing import ClassVar, Final

from vbus.core.state import Names

OFF: Final = 0
WARN: Final = 1
STRICT: Final = 2


class Policy:
    """What happens on a violation: off, warn (record, perform) or strict (record, cycle lost).

    Args:
        default: for every rule not named.
        rules: exceptions by rule name, or by family (``"lm628"`` covers ``"lm628.T14"``).
    """

    __slots__ = ("_rules", "default")
    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, default: int = WARN, rules: dict[str, int] | None = None) -> None:
        self.default: int = default
        self._rules: dict[str, int] = dict(rules or {})

    def of(self, rule: str) -> int:
        """Return :data:`OFF`, :data:`WARN` or :data:`STRICT` for the rule named ``rule``."""
        level = self._rules.get(rule)
        # A rule by its name, else its family, else the default.
        if level is None:
            level = self._rules.get(rule.partition(".")[0], self.default)
        return level
