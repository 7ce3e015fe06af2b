"""Write any arena as plain MJCF, which MuJoCo's viewer opens: ``export_arena.py --arena A --out FILE.xml``."""

try:
    from sarsim.commands.export_arena import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
