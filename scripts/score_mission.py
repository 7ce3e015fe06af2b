"""Score a mission's files as the leagues do: ``score_mission.py DIR --arena A``."""

try:
    from sarsim.plugins.league.score_mission import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
