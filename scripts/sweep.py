"""Run methods of exploration on the same arenas with the same seeds, and compare them."""

try:
    from sarsim.commands.sweep import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
