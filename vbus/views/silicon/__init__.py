"""Captures of real chips, and how a model compares with them."""
