"""The commands that this package gives `twin`: one file each, entered by their entry points."""
