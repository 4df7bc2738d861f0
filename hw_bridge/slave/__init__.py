"""A CANopen slave (CiA 301): services over an object dictionary, driven by frames and integer time."""
