"""Report the errors for which a judge would reject a mission's files: ``validate_mission.py DIR``."""

try:
    from sarsim.plugins.league.validate_mission import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
