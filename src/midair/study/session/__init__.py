"""Sessions of a study: presentation, questions, timing, the event log and simulated participants."""
