"""Design: stimuli, questions, blocks, orders, the plan, and blocks that follow the answers."""
