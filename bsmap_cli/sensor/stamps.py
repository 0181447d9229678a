"""Stamps as text: seconds with nine decimals, from and to integer nanoseconds without a float."""

from __future__ import annotations

from decimal import Decimal

LARGEST_NS = 2**63 - 1


def format_stamp(stamp_ns: int) -> str:
    """Seconds with nine decimals, exactly."""
    seconds, nanoseconds = divmod(abs(stamp_ns), 1_000_000_000)
    return f"{'-' if stamp_ns < 0 else ''}{seconds}.{nanoseconds:09d}"


def parse_stamp(text: str) -> int:
    """Nanoseconds of a decimal number of seconds, to the nearest; ValueError where it is none."""
    try:
        value = Decimal(text).scaleb(9).to_integral_value()
        if abs(value) > LARGEST_NS:
            raise ValueError(f"{text} s does not fit 64 bits of nanoseconds")
        return int(value)
    except ArithmeticError as error:
        raise ValueError(f"{text!r} is not a time in seconds") from error
