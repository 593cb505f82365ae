"""PMD MC1241A and MC1141A: microstepping motion processors."""
