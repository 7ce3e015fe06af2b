"""The commands, each of which is a module with a function ``main``, and the parts that they share."""
