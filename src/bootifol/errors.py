"""Errors that a user can act on."""


class BootifolError(Exception):
    """What was wrong, where, and what to do, in one sentence.

    The command line prints it without a traceback and exits with code 2.
    """
