"""Made from the tables of the chip by vbus.tools.generate."""
