"""Train one of the robot's networks: ``train.py NETWORK --data DIR --out FILE``."""

from sarsim.commands.train import main

if __name__ == "__main__":
    main()
