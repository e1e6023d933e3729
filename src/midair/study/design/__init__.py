"""Design of a study: stimuli, questions, blocks, trial orders, the plan and adaptive blocks."""
