"""Made from the tables of the chip by vbus.cli.generate."""
