"""The correction loop (play, re-record, correct, compare), its report, and the error budget of each stage."""
