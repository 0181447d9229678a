"""How a setting is declared beside the algorithm that uses it.

Each room keeps its settings in frozen dataclasses whose fields are made by `setting`;
`bsmap_cli.config` gathers them, reads YAML into them and prints them.
"""

from dataclasses import field
from typing import Any


def setting(
    default: Any,
    meaning: str,
    *,
    symbol: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """Declare one setting: a dataclass field with its meaning, the paper's symbol and its range.

    `minimum` and `maximum` are inclusive. Lengths that scale with the map are in knot steps;
    lengths of sensor or robot are in metres and say so in the name (`_m`, `_deg`, `_s`).
    """
    return field(
        default=default,
        metadata={
            "meaning": meaning,
            "symbol": symbol,
            "minimum": minimum,
            "maximum": maximum,
            "choices": choices,
        },
    )
