"""Round lengths for scale bars and drawing scales."""

from __future__ import annotations

import math


def round_length(length: float) -> float:
    """The greatest of 1, 2, 5 times a power of ten that is not longer than `length` > 0."""
    exponent = math.floor(math.log10(length) + 1e-12)
    for digit in (5, 2):
        if float(f"{digit}e{exponent}") <= length * (1 + 1e-9):
            return float(f"{digit}e{exponent}")
    return float(f"1e{exponent}")
