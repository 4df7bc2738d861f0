"""Recordings and the model of each experiment, from the keys of an identify file."""
