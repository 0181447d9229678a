"""The exceptions of bsmap: one root, caught once at the command line.

Every message says what is wrong and what to do next.
"""


class BsmapError(Exception):
    """Root of every error that bsmap raises on purpose."""


class LogError(BsmapError):
    """A log cannot be read, holds no usable scans, or leaves a choice to the user."""


class ConfigError(BsmapError):
    """A setting is unknown or out of its range (exit code 2)."""


class UsageError(BsmapError):
    """The command line asks for something contradictory or ambiguous (exit code 2)."""


class FitError(BsmapError):
    """A cluster of points cannot carry a curve."""


class TrackingError(BsmapError):
    """No pose explains the scans."""


class MapFileError(BsmapError):
    """A map file is damaged, truncated or of a later version."""
