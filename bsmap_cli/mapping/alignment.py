"""Find the offset of a curve on its map curve when the pose is known: eqs. (9)-(11)."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentSettings:
    """Gauss-Newton on the offset of one curve."""

    samples: int = setting(20, "samples of the overlap", symbol="r", minimum=2)
    iterations: int = setting(5, "most Gauss-Newton steps", minimum=1)
