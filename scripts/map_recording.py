"""Map a recording (a TUM RGB-D folder, a ROS bag or a scene): ``map_recording.py PATH --out DIR``."""

try:
    from sarsim.commands.map_recording import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
