"""Generate a labelled RGB-D dataset in random rescue arenas."""

try:
    from sarsim.commands.generate_dataset import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
