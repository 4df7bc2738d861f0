"""Commands of `twin hil`, one file for related ones."""
