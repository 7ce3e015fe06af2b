"""Drive the robot through an arena by keyboard or gamepad, in MuJoCo's viewer: ``teleop.py --arena A``."""

try:
    from sarsim.commands.teleop import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
