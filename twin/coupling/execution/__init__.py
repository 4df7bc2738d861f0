"""The compiled loop: its plan, tables, recording, profiling, and what is reported when a step fails."""
