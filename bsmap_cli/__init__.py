"""bsmap: 2D range scans to compact B-spline maps and trajectories."""

__version__ = "0.1.0"
