"""What is followed over frames until it is confirmed: people, and all else that a rescue robot looks for."""
