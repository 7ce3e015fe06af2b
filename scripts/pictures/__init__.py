"""Code that draws the pictures for the README and the documentation, one module per picture or page."""
