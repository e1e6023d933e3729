"""A recorder of every figure that midair prints or writes, to show that a change of the code changes no number.

``python -m tests.regression --write FILE`` runs the commands of `commands.txt` on the virtual rig and records their
figures; ``python -m tests.regression --against FILE`` runs them again and lists each figure that differs.
"""
