"""Makes the files that follow from tables: client calls, blocking clients, documentation.

``python -m vbus.cli.generate clients`` writes them, ``--check`` only compares. The results are
committed; a test makes them again and compares.
"""
