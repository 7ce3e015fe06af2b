"""Map a recording (a TUM RGB-D folder, a ROS bag or a scene): ``map_recording.py PATH --out DIR``."""

from sarsim.commands.map_recording import main

if __name__ == "__main__":
    main()
