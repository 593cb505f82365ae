"""What test suites of firmware, drivers, and new chips use.

Nothing here is imported by the server; some of it wants ``vbus[test]`` (pytest, Hypothesis).
"""
