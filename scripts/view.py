"""Open the recording of an episode in the Rerun viewer: ``view.py PATH [--web]``."""

from sarsim.commands.view import main

if __name__ == "__main__":
    main()
