"""The AC tables of all chip families that are registered, for those who explain them."""

from collections.abc import Iterator
from functools import cache

from vbus import plugins
from vbus.chips.strobes import AcTable


def ac_tables() -> Iterator[tuple[str, str, AcTable]]:
    """Give every table of AC characteristics: family, supply (or ""), table."""
    for family in plugins.families():
        for supply, table in family.ac_tables.items():
            yield family.name, supply, table


def ac_limits(rule: str) -> list[str]:
    """Return the row of the manual's AC table that a rule checks, once for each supply.

    Args:
        rule: name of the rule, such as ``lm628.T14``.

    Returns:
        ``["T14: at least 100 ns"]``, ``["tSDR at 5 V: at least 2.1 ns", ...]``; empty if the rule
        is no row of such a table.
    """
    family, _, symbol = rule.partition(".")
    limits = []
    for owner, supply, table in ac_tables():
        for row in table:
            if owner == family and row.symbol == symbol:
                least = [f"{row.min_ps / 1000:g} ns"] if row.min_ps else []
                least += [f"{row.min_clk:g} clk"] if row.min_clk else []
                minimum = f"at least {' + '.join(least) or '0 ns'}"
                limit = f"at most {row.max_ps / 1000:g} ns" if row.max_ps else minimum
                both = f"{minimum}, {limit}" if row.max_ps and least else limit
                limits.append(f"{symbol}{f' at {supply}' if supply else ''}: {both}")
    return limits


@cache
def ac_rules() -> frozenset[str]:
    """Return the names of the rules that measure an interval, in ps."""
    return frozenset(rule.name for _, _, table in ac_tables() for rule in table.rules.values())
