"""The command `twin`, also as `python -m twin`."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while its modules are imported ends it in one line, with exit code 130."""
    try:
        from twin.process import handle_signals

        handle_signals()
        from twin.cli import main as run_command_line
    except BaseException as error:
        if KeyboardInterrupt not in (type(error), type(error.__cause__)):  # RuntimeError where a class was being made
            raise
        sys.stderr.write("\ninterrupted\n")  # as click: the terminal has shown ^C
        sys.exit(130)
    run_command_line()


if __name__ == "__main__":
    main()
