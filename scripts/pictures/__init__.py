"""The code that draws the pictures of the README and the documentation, one module per picture or page."""
