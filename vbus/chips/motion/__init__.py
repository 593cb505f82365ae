"""What several chips share: trapezoid step, velocity ramp, S-curve, quadrature decoder."""
