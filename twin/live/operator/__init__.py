"""Commands of the operator: checks, execution, dead-man switch, log."""
