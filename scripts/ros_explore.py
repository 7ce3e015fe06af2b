"""Explore with a ROS 2 robot: ``ros_explore.py --out DIR``."""

from sarsim.commands.ros_explore import main

if __name__ == "__main__":
    main()
