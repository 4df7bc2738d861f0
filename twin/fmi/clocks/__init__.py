"""Clocks of FMI 3.0: Event Mode, Scheduled Execution, clocks of Model Exchange."""
