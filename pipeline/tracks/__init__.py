"""Tracking people, and everything else that a rescue robot looks for, over frames until they are confirmed."""
