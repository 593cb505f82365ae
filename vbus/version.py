"""The version of this vbus."""

__version__ = "0.1.0"
