"""Run methods of exploration on the same arenas with the same seeds, and compare them."""

from sarsim.commands.sweep import main

if __name__ == "__main__":
    main()
