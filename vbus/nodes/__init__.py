"""Boards with nodes: parts with a kernel each, wires between them, and one virtual time."""
