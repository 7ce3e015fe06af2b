"""The rescue report: one page with the information that rescuers need before they go in."""
