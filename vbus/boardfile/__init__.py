"""The board file: its sections, and the walker that reads them."""
