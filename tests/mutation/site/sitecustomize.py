"""Imported by each Python that a test of a mutant starts: the mutant is there, too."""

from tests.mutation.finder import install

install()
