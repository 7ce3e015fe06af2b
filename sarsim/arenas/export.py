"""Arenas as files."""

from pathlib import Path

from dm_control import mjcf

from pipeline.files import whole_file


def write_mjcf(root: mjcf.RootElement, path: Path) -> None:
    """Write a model, and beside it the files that it refers to.

    Raises:
        InputError: they cannot be written.
    """
    for name, content in root.get_assets().items():
        with whole_file(path.parent / name) as part:
            part.write_bytes(content)
    with whole_file(path) as part:
        part.write_text(root.to_xml_string())
