"""Laws without a robot: rigid motions, B-spline curves, least squares."""
