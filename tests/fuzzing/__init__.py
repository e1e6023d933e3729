"""Files of strangers, made by the thousand: sound ones, damaged by somebody who knows how they are built.

``python -m tests.fuzzing --count 40000`` damages and reads so many and says what came of it.
"""
