"""Generate a labelled RGB-D dataset in random rescue arenas."""

from sarsim.commands.generate_dataset import main

if __name__ == "__main__":
    main()
