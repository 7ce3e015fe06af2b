"""The rescue report: one page by which a rescue team can act before they go in."""
