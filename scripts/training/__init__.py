"""The networks that ``train.py`` trains."""
