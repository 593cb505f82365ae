"""The DC-8, an 8-bit down counter: a made-up chip."""
