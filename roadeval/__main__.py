"""The program: ``roadeval``, or ``python -m roadeval`` with the Python that is named."""

import signal
import sys
from contextlib import suppress


def main() -> int:
    """Run the command line of this process; return the exit code.

    Until the command is loaded and has handlers of its own (see `roadeval.cli.signals`), there is
    nothing to close: SIGINT ends the process as the system does, not with Python's traceback. Where
    it is ignored, as behind ``nohup``, it stays so.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        with suppress(ValueError):  # only the main thread can
            signal.signal(signal.SIGINT, signal.SIG_DFL)
    from roadeval.cli import app

    return app.main()


if __name__ == "__main__":
    sys.exit(main())
