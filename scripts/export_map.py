"""Write the map of an episode for other programs: ``export_map.py EPISODE --out FILE.bt|.ot|.ply|.pgm|.tif|…``."""

from sarsim.commands.export_map import main

if __name__ == "__main__":
    main()
