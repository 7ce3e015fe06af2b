"""Run an episode: the robot explores an arena, builds its maps and writes a recording and a report."""

try:
    from sarsim.commands.run_episode import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
