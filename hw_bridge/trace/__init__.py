"""What was on the bus: trace files, their meaning, and what is made of them."""
