"""``python -m vbus``, and the ``vbus`` command."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while it is still being imported ends it as later."""
    try:
        if sys.argv[1:] in (["--version"], ["-V"]):
            from vbus.compiled import version_line

            print(version_line())  # without the parser of the command line, which takes longer
            return
        from vbus.core.collection import collection_held, keep_what_is_made

        with collection_held():
            from vbus.cli.cli import main as run

            keep_what_is_made()
    except KeyboardInterrupt:
        from vbus.core.exit_codes import INTERRUPTED

        sys.exit(INTERRUPTED)
    run()


if __name__ == "__main__":
    main()
