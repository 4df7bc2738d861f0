"""The commands of `twin hil`, one file for those that belong together."""
