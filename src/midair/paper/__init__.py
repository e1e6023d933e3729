"""The paper's figures and numbers made again, in its own mode and in the best one."""
