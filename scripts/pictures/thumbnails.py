"""Cut README's thumbnails out of the pages' pictures, so that each thumbnail is legible at its small size."""

from pathlib import Path

from PIL import Image

from scripts.pictures.layout import IMAGES

SIZE = (420, 280)  # px, about one and a half times as large as README shows them
CROPS = {
    "arenas": ("arenas-random", [(60, 30, 810, 530)]),
    "recording": ("recording-native", [(150, 130, 1050, 730)]),
    "report": ("rescue-report", [(62, 258, 748, 715)]),
    "dataset": ("camera", [(0, 36, 248, 366), (912, 36, 1160, 366)]),
    "rooms": ("real-desk", [(70, 0, 250, 240), (390, 0, 570, 240)]),
    "grid": ("metric-map", [(820, 562, 1576, 1066)]),
}
"""By thumbnail: the picture, and the pieces (left, upper, right, lower, pixels) that are put side by side."""


def thumbnail(picture: Image.Image, pieces: list[tuple[int, int, int, int]]) -> Image.Image:
    """The pieces of a picture side by side."""
    width, height = SIZE[0] // len(pieces), SIZE[1]
    made = Image.new("RGB", SIZE)
    for index, piece in enumerate(pieces):
        made.paste(picture.resize((width, height), Image.Resampling.LANCZOS, box=piece), (index * width, 0))
    return made


def draw(_: Path) -> None:
    """Cut all thumbnails."""
    for name, (file, pieces) in CROPS.items():
        with Image.open(IMAGES / f"{file}.jpg") as picture:
            thumbnail(picture.convert("RGB"), pieces).save(IMAGES / f"thumbnail-{name}.jpg", quality=85)
