"""Entry point of `bsmap` and of `python -m bsmap_cli`."""

import sys


def main() -> int:
    """Run the command line; the exit code. Nothing heavy is imported before Ctrl-C is caught."""
    try:
        from bsmap_cli.cli.door import run

        return run(sys.argv[1:])
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
