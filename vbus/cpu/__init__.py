"""Processors that an emulator runs: a host of a board like any other (``vbus exec --cpu``)."""
