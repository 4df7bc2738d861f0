"""A simulated CiA 402 drive on top of a CANopen slave."""
