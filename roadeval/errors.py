"""The one base of every error that a user can cause and mend."""

from roadeval.runtime.text import without_secrets


class RoadevalError(Exception):
    """A known problem: one line that says what is wrong, where, and what to do next.

    A message names a setting as in a configuration, between backticks: ```topics.truth```. The
    terminal puts the flag of the command line in its place. URLs in it lose their passwords.

    The terminal prints it without a traceback and exits with code 1. Rooms derive their own
    errors from it; anything else that escapes is a defect of the program.
    """

    def __str__(self) -> str:
        return without_secrets(super().__str__())
