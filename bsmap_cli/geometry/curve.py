"""One uniform, non-clamped B-spline curve of the plane: paper Sec. II."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.se2 import Points, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """s(tau) = sum_g c_g beta_d(tau / Delta - g), g = I .. I + N - 1 (0-based lattice indices).

    The knots are (I + i) Delta, i = 0 .. N + d. The domain is [(I + d) Delta, (I + N) Delta],
    closed on the right; data support only [tau_start_m, tau_end_m] of it. Curve direction is
    beam order, so the free side is on the left.

    control_points : (N, 2) float64 [m]; weights : (N,) float64, how often each was observed.
    """

    degree: int
    knot_step_m: float
    first_index: int
    control_points: Points
    weights: Vector
    tau_start_m: float
    tau_end_m: float

    @property
    def span_count(self) -> int:
        """Number of polynomial pieces, N - d."""
        return len(self.control_points) - self.degree

    def locate(self, tau_m: Vector) -> tuple[NDArray[np.int64], Vector]:
        """Row of the first active control point and the fraction f of the span, for each tau.

        tau is clamped to the domain, whose right end is closed.
        """
        u = np.asarray(tau_m, float) / self.knot_step_m - (self.first_index + self.degree)
        span = np.clip(np.floor(u), 0, self.span_count - 1).astype(np.int64)
        return span, np.clip(u - span, 0.0, 1.0)

    def evaluate(self, tau_m: Vector, derivative: int = 0) -> Points:
        """(m, 2) points [m] at tau, or derivatives of the given order with respect to tau."""
        span, f = self.locate(tau_m)
        powers = np.zeros((len(f), self.degree + 1))
        for p in range(derivative, self.degree + 1):
            falling = np.prod(np.arange(p - derivative + 1, p + 1))
            powers[:, p] = falling * f ** (p - derivative)
        weights = powers @ basis_matrix(self.degree).T / self.knot_step_m**derivative
        active = self.control_points[span[:, None] + np.arange(self.degree + 1)]
        return np.asarray(np.einsum("ma,mac->mc", weights, active))
