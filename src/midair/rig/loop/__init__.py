"""The loop: play, re-record, correct, play again, compare; its report, and where each loss comes from."""
