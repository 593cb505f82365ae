"""``python -m vbus``: the command line."""

from vbus.tools.cli import main

main()
