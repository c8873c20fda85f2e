"""Errors that a user can act on."""


class BootifolError(Exception):
    """What was wrong, where, and what to do, in one sentence.

    The command line prints it without a traceback and exits with code 2.
    """


def require_at_least(minimum: float, **fields: float) -> None:
    """Refuses a configuration's numbers below a minimum; NaN too.

    Raises:
        BootifolError: names the first field that is too small.
    """
    for name, value in fields.items():
        if not value >= minimum:
            raise BootifolError(f"{name} must be at least {minimum}, not {value}")
