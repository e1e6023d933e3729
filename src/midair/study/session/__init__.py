"""A session: present, ask, time, store; and participants who are simulated."""
