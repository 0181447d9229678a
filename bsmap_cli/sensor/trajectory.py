"""Where the base was, one pose for every scan read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Trajectory:
    """stamps_ns : (m,) int64, in log order; poses : (m, 3) float64 x, y [m], yaw [rad]."""

    stamps_ns: NDArray[np.int64]
    poses: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.stamps_ns)
