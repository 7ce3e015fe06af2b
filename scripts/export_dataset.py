"""Export a dataset to a layout that other tools read: ``export_dataset.py FORMAT --data DIR --out DIR``."""

from sarsim.commands.export_dataset import main

if __name__ == "__main__":
    main()
