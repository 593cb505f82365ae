"""A board on another computer as links on this one: ``vbus attach``."""
