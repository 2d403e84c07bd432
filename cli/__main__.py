"""The process of the command `dualdrive`: the guard stands before anything else is imported."""

from __future__ import annotations

from dualdrive_cli._stop import guard


def main() -> None:
    """Run the verb that the command line asks for."""
    guard.stand()
    from dualdrive_cli.main import main as verbs

    verbs(prog_name="dualdrive")


if __name__ == "__main__":
    main()
