"""Gauss-Newton equations of pose and offset for each pair of curves: Sec. IV.

For a pair with map curve m, scan curve k, pose xi and offset s the samples u_j lie on the common
part of both, and with q = R(theta) k(u_j - s)

    e = m(u_j) - T(xi, k(u_j - s))      J = [1 0 -q_y; 0 1 q_x]      d = R(theta) k'(u_j - s)

minimise sum w |e - J dxi - d du|^2. The argument shift du changes the offset by -du: the paper
adds it, and with that sign runs away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.curve_jet import curve_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.alignment import LEAST_OVERLAP
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.slam.curve_pairs import CurvePairs

Integers = NDArray[np.int64]


@dataclass(slots=True)
class CurveEquations:
    """Normal equations of every pair at one point of the iteration.

    hessians : (P, 4, 4), gradients : (P, 4), order x, y, theta, u; u in lattice units. overlaps :
    (P,) common length [knot steps], 0 where a pair has none. squares : (P,) weighted sum of e^2;
    levers : (P,) of |q|^2; weights : (P,) sum of w.
    """

    hessians: Vector
    gradients: Points
    overlaps: Vector
    squares: Vector
    levers: Vector
    weights: Vector


class PairSystem:
    """Pairs of curves as flat arrays, ready to be linearised about any pose and offset.

    samples : r, on each overlap; dense : at least so many to a knot step; kernel_m : residual
    at which a robust weight has fallen to a quarter, infinite for plain least squares.
    """

    def __init__(
        self,
        curve_map: CurveMap,
        pairs: CurvePairs,
        *,
        samples: int,
        dense: float = 0.0,
        kernel_m: float = math.inf,
    ) -> None:
        counts = [len(curve.control_points) for curve in pairs.curves]
        self.curve_map = curve_map
        self.offsets = np.array(pairs.offsets, float)
        self._rows = np.concatenate(([0], np.cumsum(counts))).astype(np.int64)
        points = [curve.control_points for curve in pairs.curves]
        self._points = np.concatenate([np.zeros((0, 2)), *points])
        self._firsts = np.array([curve.first_index for curve in pairs.curves], np.int64)
        self._supports = np.array(pairs.supports, float).reshape(-1, 2)
        self._map_curves = np.array(pairs.map_curves, np.int64)
        self._samples, self._dense, self._kernel_m = samples, dense, kernel_m

    def linearise(self, poses: Points) -> CurveEquations:
        """The equations about `poses`, (P, 3) one a pair, and the offsets as they are."""
        n = len(self.offsets)
        equations = CurveEquations(
            np.zeros((n, 4, 4)), np.zeros((n, 4)), *(np.zeros(n) for _ in range(4))
        )
        _sum_equations(
            self.curve_map.arrays,
            self.curve_map.matrix,
            self._points,
            self._rows,
            self._firsts,
            self._supports,
            self._map_curves,
            self.offsets,
            poses,
            self._samples,
            self._dense,
            self._kernel_m**-2.0,
            equations.hessians,
            equations.gradients,
            equations.overlaps,
            equations.squares,
            equations.levers,
            equations.weights,
        )
        return equations


@kernel
def _sum_equations(
    level: LevelArrays,
    matrix: Points,
    points: Points,
    rows: Integers,
    firsts: Integers,
    supports: Points,
    map_curves: Integers,
    offsets: Vector,
    poses: Points,
    samples: int,
    dense: float,
    kernel: float,
    hessians: Vector,
    gradients: Points,
    overlaps: Vector,
    squares: Vector,
    levers: Vector,
    weights: Vector,
) -> None:
    row = np.empty((2, 4))
    row[0, 0] = row[1, 1] = 1.0
    row[0, 1] = row[1, 0] = 0.0
    for p in range(len(map_curves)):
        curve = map_curves[p]
        offset = level.offset[curve]
        map_points = level.points[offset : offset + level.count[curve]]
        scan_points = points[rows[p] : rows[p + 1]]
        low = max(level.support[curve, 0], supports[p, 0] + offsets[p])
        high = min(level.support[curve, 1], supports[p, 1] + offsets[p])
        if high - low < LEAST_OVERLAP:
            continue
        overlaps[p] = high - low
        count = max(samples, math.ceil(dense * (high - low)))
        cos, sin = math.cos(poses[p, 2]), math.sin(poses[p, 2])
        for j in range(count):
            u = low + (high - low) * (j + 0.5) / count
            mx, my, _, _ = curve_jet(map_points, level.first[curve], matrix, u)
            kx, ky, dx, dy = curve_jet(scan_points, firsts[p], matrix, u - offsets[p])
            qx, qy = cos * kx - sin * ky, sin * kx + cos * ky
            ex, ey = mx - qx - poses[p, 0], my - qy - poses[p, 1]
            row[0, 2], row[1, 2] = -qy, qx  # nabla_xi T
            row[0, 3], row[1, 3] = cos * dx - sin * dy, sin * dx + cos * dy  # nabla_tau T
            square = ex * ex + ey * ey
            weight = (high - low) / count / (1.0 + kernel * square) ** 2
            for a in range(4):
                gradients[p, a] += weight * (row[0, a] * ex + row[1, a] * ey)
                for b in range(4):
                    hessians[p, a, b] += weight * (row[0, a] * row[0, b] + row[1, a] * row[1, b])
            squares[p] += weight * square
            levers[p] += weight * (qx * qx + qy * qy)
            weights[p] += weight
