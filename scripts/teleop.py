"""Drive the robot through an arena by keyboard or gamepad, in MuJoCo's viewer: ``teleop.py --arena A``."""

from sarsim.commands.teleop import main

if __name__ == "__main__":
    main()
