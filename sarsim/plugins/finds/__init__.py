"""Signs, codes and shapes: their readers as a plug-in, and their score."""
