"""A sieve for ideas about exploration: a robot that is a point explores a hundred 2D maps in a minute.

Run it with ``python -m scripts.benchmarks.sieve``; ``--help`` lists what it takes. To try an idea, add a function to
``EXPLORERS`` in explorers.py: at every node of a lattice, it decides to which node the robot goes next. What passes
here is worth trying in MuJoCo, which takes hours.
"""
