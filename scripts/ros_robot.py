"""The simulated robot as a ROS 2 robot: ``ros_robot.py --arena A``."""

from sarsim.commands.ros_robot import main

if __name__ == "__main__":
    main()
