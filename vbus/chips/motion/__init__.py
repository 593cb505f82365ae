"""What several chips share: trapezoid step, S-curve plan, quadrature decoder, comparators."""
