"""Terms that a solver can add to the error of the paper, one file each; `SolverSettings` has a setting for each."""
