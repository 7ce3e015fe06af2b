"""Run an episode: the robot explores an arena, builds its maps and writes a recording and a report."""

from sarsim.commands.run_episode import main

if __name__ == "__main__":
    main()
