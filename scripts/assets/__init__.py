"""Scripts that generate files in ``assets/``: the laboratory floor, the victims and the splits of arenas."""
