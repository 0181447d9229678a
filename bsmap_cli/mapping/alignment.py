"""Find the offset of a curve on its map curve when the pose is known: eqs. (9)-(11).

An offset and a shift of the argument have opposite signs: moving a curve on by s makes it
k(tau - s). The minimiser of eq. (10) is the argument shift; eq. (11), with its minus, is the
offset that is added to tau_1. Both signs are the paper's, only their names are mixed up there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.curve_jet import curve_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.settings import setting

LEAST_OVERLAP = 1.0  # common part that still ties two curves together [knot steps]
STILL = 1e-4  # a smaller step ends the iteration [knot steps]


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentSettings:
    """Gauss-Newton on the offset of one curve."""

    samples: int = setting(20, "samples of the overlap", symbol="r", minimum=2)
    iterations: int = setting(5, "most Gauss-Newton steps", minimum=1)


@kernel
def _align(
    map_points: Points,
    map_first: int,
    map_support: Vector,
    points: Points,
    first: int,
    support: Vector,
    matrix: Points,
    samples: int,
    iterations: int,
) -> tuple[bool, float]:
    """Whether the curves overlap, and the offset [lattice units] to add to the scan curve's u."""
    offset = 0.0
    for _ in range(iterations):
        low = max(map_support[0], support[0] + offset)
        high = min(map_support[1], support[1] + offset)
        if high - low < LEAST_OVERLAP:
            return False, offset
        h = g = 0.0
        for j in range(samples):
            u = low + (high - low) * (j + 0.5) / samples
            mx, my, _, _ = curve_jet(map_points, map_first, matrix, u)
            kx, ky, dx, dy = curve_jet(points, first, matrix, u - offset)
            h += dx * dx + dy * dy
            g += dx * (mx - kx) + dy * (my - ky)
        if h <= 0.0:
            return False, offset
        step = -g / h  # eq. (11)
        offset += step
        if abs(step) < STILL:
            break
    low = max(map_support[0], support[0] + offset)
    high = min(map_support[1], support[1] + offset)
    return high - low >= LEAST_OVERLAP, offset


def align_offset(map_curve: Curve, scan_curve: Curve, settings: AlignmentSettings) -> float | None:
    """What to add to the scan curve's tau [m] so that it runs along the map curve.

    Both curves are in the map frame, of one degree and knot step. The samples lie on the part of
    both that data support. None where they share less than one knot step, at first or at the end.
    """
    step = map_curve.knot_step_m
    overlaps, offset = _align(
        map_curve.control_points,
        map_curve.first_index,
        _support_u(map_curve),
        scan_curve.control_points,
        scan_curve.first_index,
        _support_u(scan_curve),
        basis_matrix(map_curve.degree),
        settings.samples,
        settings.iterations,
    )
    return offset * step if overlaps else None


def _support_u(curve: Curve) -> Vector:
    return np.array([curve.tau_start_m, curve.tau_end_m]) / curve.knot_step_m
