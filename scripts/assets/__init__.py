"""What writes the files in assets/ that no hand writes: the laboratory floor and the people."""
