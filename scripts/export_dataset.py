"""Export a dataset to a layout that other tools read: ``export_dataset.py FORMAT --data DIR --out DIR``."""

try:
    from sarsim.commands.export_dataset import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
