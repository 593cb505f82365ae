"""Where a long computation lets the interpreter hear signals; never compiled."""


def check_interrupts() -> None:
    """Let Ctrl-C interrupt.

    Python runs the handlers of signals when it begins an interpreted function; a compiled one never
    asks for them.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
