"""Bodies in contact, in a plane, with pymunk: what Python-side components of instruments share."""
