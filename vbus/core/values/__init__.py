"""Values as people write them: quantities with units, settings, the words of conditions."""
