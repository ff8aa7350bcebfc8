"""The command `cosim`, also as `python -m cosim`.

Until it is loaded nothing is to be tidied up: a signal just ends the process. Once it has ended, one changes nothing.
"""

import signal
from contextlib import suppress


def main() -> None:
    """Run the command line and leave with its exit code."""
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # not where it runs in the background
    if heard:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from cosim.cli import main as command

    if heard:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        command()
    finally:
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            with suppress(AttributeError, ValueError):
                signal.signal(getattr(signal, name), signal.SIG_IGN)


if __name__ == "__main__":
    main()
