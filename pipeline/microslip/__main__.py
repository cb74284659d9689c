"""``python -m microslip`` and the console script: requests to end are heard before anything large is loaded."""

from .interrupts import listen


def entry() -> None:
    """The command line."""
    listen()
    from .cli import entry as typed

    typed()


if __name__ == "__main__":
    entry()
