"""FMUs for Model Exchange: members, connected systems of equations, solvers."""
