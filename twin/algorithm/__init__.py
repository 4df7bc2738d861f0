"""Co-simulation algorithms: the compiled loop, the table it walks, and the one who fills the table."""
