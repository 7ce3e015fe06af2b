"""Report what a judge would reject in a mission's files: ``validate_mission.py DIR``."""

from sarsim.commands.validate_mission import main

if __name__ == "__main__":
    main()
