"""What draws the pictures of README and the documents, one module per picture or page."""
