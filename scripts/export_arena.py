"""Write any arena as plain MJCF, which MuJoCo's viewer opens: ``export_arena.py --arena A --out FILE.xml``."""

from sarsim.commands.export_arena import main

if __name__ == "__main__":
    main()
