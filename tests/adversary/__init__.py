"""Attempts at making the tool lose, hang, leak or say nothing: `python -m tests.adversary`."""
