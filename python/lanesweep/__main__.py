"""The command line: ``python -m lanesweep``."""

from __future__ import annotations

import os
import signal
import sys

from . import _core


def main() -> None:
    """Run the command line of this process and end it with the program's exit code."""
    # The program handles signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    code = _core.main(sys.argv[1:])
    # The program has flushed its output; threads of drivers are not waited for.
    os._exit(code)


if __name__ == "__main__":
    main()
