"""The rescue report: one page that a rescue team can act on before they go in."""
