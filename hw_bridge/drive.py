"""`python -m hw_bridge.drive`: the same as `twin drive`."""

from __future__ import annotations

from hw_bridge.command.drive import main

if __name__ == "__main__":
    main()
