"""Victims: people who lie, sit or lean in an arena."""
