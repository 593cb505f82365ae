"""``python -m vbus``, and the ``vbus`` command."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while it is still being imported ends it as later."""
    try:
        from vbus.tools.cli import main as run
    except KeyboardInterrupt:
        from vbus.tools.exit_codes import INTERRUPTED

        sys.exit(INTERRUPTED)
    run()


if __name__ == "__main__":
    main()
