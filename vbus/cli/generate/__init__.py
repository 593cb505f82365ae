"""Makes what follows from the tables of a chip: client calls, numbers, pages, decoders.

``python -m vbus.cli.generate --family NAME``; those of the source tree: ``contrib/generate``.
"""
