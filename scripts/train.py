"""Train one of the robot's networks: ``train.py NETWORK --data DIR --out FILE``."""

try:
    from sarsim.commands.train import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
