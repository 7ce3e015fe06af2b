"""Write the map of an episode for other programs: ``export_map.py EPISODE --out FILE.bt|.ot|.ply|.pgm|.tif|…``."""

try:
    from sarsim.commands.export_map import main
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error.name} is not installed; run: make setup && source .venv/bin/activate") from None

if __name__ == "__main__":
    main()
