"""Keys of a scenario, their types and units, and the messages about wrong ones."""
