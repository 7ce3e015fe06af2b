"""The simulated robot as a ROS 2 robot: ``ros_robot.py --arena A``."""

try:
    from sarsim.plugins.ros.ros_robot import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
