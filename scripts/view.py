"""Open the recording of an episode in the Rerun viewer: ``view.py PATH [--web]``."""

try:
    from sarsim.commands.view import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
