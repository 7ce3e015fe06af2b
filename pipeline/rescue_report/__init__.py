"""The rescue report: one page that tells rescuers what they need to know before they go in."""
