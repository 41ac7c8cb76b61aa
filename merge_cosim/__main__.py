"""The command line, as `merge-cosim` and as `python -m merge_cosim`."""

import sys

from merge_cosim.core.signals import interrupted_once


def main() -> None:
    """Run the command line; an interrupt ends it without a traceback also while it is being loaded."""
    interrupted_once()
    try:
        from merge_cosim.cli.main import main as command

        command()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
