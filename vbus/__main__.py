"""``python -m vbus``, and the ``vbus`` command."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while it is still being imported ends it as later."""
    try:
        if sys.argv[1:] in (["--version"], ["-V"]):
            from vbus.compiled import version_line

            print(version_line())  # without the parser of the command line, which takes longer
            return
        from vbus.core.interpreter import collection_held, keep_what_is_made

        with collection_held():
            from vbus.cli.cli import main as run

            keep_what_is_made()
        run()
    except KeyboardInterrupt:
        sys.exit(130)  # INTERRUPTED of exit_codes: no import here, which a second one would end


if __name__ == "__main__":
    main()
