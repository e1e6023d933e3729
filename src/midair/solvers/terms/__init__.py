"""What a solver may be asked for beside the paper's error: each term in a file of its own, shared by the solvers.

The functions of a term work on arrays of any library of the array API standard; rows are frames. Which solver takes
which term: `midair.solvers.methods.TAKES`.
"""
