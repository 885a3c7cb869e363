"""The program ``roadeval``, which ``python -m roadeval`` runs as well."""

import signal
import sys
from contextlib import suppress


def main() -> int:
    """Run the command line of this process; return the exit code.

    Until the command is loaded and has installed its handlers (see `roadeval.cli.signals`), SIGINT
    ends the process without a traceback, since there is nothing to close. An ignored SIGINT, as
    behind ``nohup``, stays ignored.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        with suppress(ValueError):  # only the main thread can
            signal.signal(signal.SIGINT, signal.SIG_DFL)
    from roadeval.cli import app

    return app.main()


if __name__ == "__main__":
    sys.exit(main())
