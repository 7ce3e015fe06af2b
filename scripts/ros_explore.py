"""Explore with a ROS 2 robot: ``ros_explore.py --out DIR``."""

try:
    from sarsim.plugins.ros.ros_explore import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
