"""Score a mission's files as the leagues do: ``score_mission.py DIR --arena A``."""

from sarsim.commands.score_mission import main

if __name__ == "__main__":
    main()
