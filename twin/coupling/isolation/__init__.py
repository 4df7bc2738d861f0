"""Members in separate processes."""
