"""The one base of every error that a user can cause and mend."""


class RoadevalError(Exception):
    """A known problem: one line that says what is wrong, where, and what to do next.

    The terminal prints it without a traceback and exits with code 1. Rooms derive their own
    errors from it; anything else that escapes is a defect of the program.
    """
