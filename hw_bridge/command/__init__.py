"""Commands of this package for `twin`: one file each, loaded by their entry points."""
