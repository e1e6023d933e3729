"""Rigs: devices, flow and files put together into what a person does: record, play, loop."""
