"""The ``.cfg`` texts of YOLOv3, of YOLOv3-tiny, and of a YOLOv3 small enough for a robot's processor.

``assets/weights`` has the first two as published, for COCO's classes.
"""

from collections.abc import Sequence

COCO_CLASSES = 80
Anchors = Sequence[tuple[float, float]]
# Fitted to COCO by Redmon and Farhadi, arXiv:1804.02767, and as in the published yolov3-tiny.cfg.
COCO_ANCHORS = ((10, 13), (16, 30), (33, 23), (30, 61), (62, 45), (59, 119), (116, 90), (156, 198), (373, 326))
COCO_TINY_ANCHORS = ((10, 14), (23, 27), (37, 58), (81, 82), (135, 169), (344, 319))


class CfgWriter:
    """Writes the ``text`` of a ``.cfg``, section by section."""

    def __init__(self, width: int, height: int, classes: int, anchors: Anchors) -> None:
        """Begin a network for images of ``width`` × ``height`` pixels; the anchors are sorted from small to large."""
        self._classes, self._anchors = classes, anchors
        self.text = ""
        self._count = -1
        self.section("net", width=width, height=height, channels=3)

    def section(self, kind: str, **settings: object) -> int:
        """Add a section; returns the number of its layer."""
        lines = [f"{'from' if key == 'source' else key}={value}\n" for key, value in settings.items()]
        self.text += f"[{kind}]\n" + "".join(lines) + "\n"
        self._count += 1
        return self._count - 1

    def conv(self, filters: int, size: int, stride: int = 1) -> int:
        """Add a convolution with batch normalization and leaky ReLU; returns the number of its layer."""
        return self.section(
            "convolutional", batch_normalize=1, filters=filters, size=size, stride=stride, pad=1, activation="leaky"
        )

    def residual(self, filters: int) -> int:
        """Add a residual block of Darknet-53; returns the number of its last layer."""
        self.conv(filters // 2, 1)
        self.conv(filters, 3)
        return self.section("shortcut", source=-3, activation="linear")

    def head(self, mask: Sequence[int]) -> None:
        """Add a [yolo] for the anchors with the numbers of ``mask``, and the convolution before it."""
        filters = len(mask) * (5 + self._classes)
        self.section("convolutional", filters=filters, size=1, stride=1, pad=1, activation="linear")
        self.section(
            "yolo",
            mask=",".join(map(str, mask)),
            anchors=", ".join(f"{w:g},{h:g}" for w, h in self._anchors),
            classes=self._classes,
            num=len(self._anchors),
        )

    def upward(self, back: int, filters: int, skip: int) -> None:
        """Go from the layer ``back`` before the head to the next finer scale, joined with layer ``skip``."""
        self.section("route", layers=-back)
        self.conv(filters, 1)
        self.section("upsample", stride=2)
        self.section("route", layers=f"-1,{skip}")

    def pyramid(self, stages: Sequence[tuple[int, int]], scales: Sequence[int], pairs: int) -> None:
        """Add stages (filters, residual blocks) that each halve the image, and heads from the coarsest scale on.

        Before each head are ``pairs`` pairs of convolutions, with the filters given by ``scales`` and twice as many.
        """
        ends = []
        for filters, blocks in stages:
            self.conv(filters, 3, 2)
            ends.append([self.residual(filters) for _ in range(blocks)][-1])
        for scale, filters in enumerate(scales):
            if scale > 0:
                self.upward(4, filters, ends[-1 - scale])
            for _ in range(pairs):
                self.conv(filters, 1)
                self.conv(2 * filters, 3)
            self.head(range(6 - 3 * scale, 9 - 3 * scale))


def yolov3(width: int, height: int, classes: int, anchors: Anchors) -> str:
    """The ``.cfg`` of YOLOv3: Darknet-53 with three scales and nine anchors."""
    cfg = CfgWriter(width, height, classes, anchors)
    cfg.conv(32, 3)
    cfg.pyramid(((64, 1), (128, 2), (256, 8), (512, 8), (1024, 4)), (512, 256, 128), 3)
    return cfg.text


def yolov3_tiny(width: int, height: int, classes: int, anchors: Anchors) -> str:
    """The ``.cfg`` of YOLOv3-tiny: convolutions with max pooling between them, two scales and six anchors."""
    cfg = CfgWriter(width, height, classes, anchors)
    for filters in (16, 32, 64, 128):
        cfg.conv(filters, 3)
        cfg.section("maxpool", size=2, stride=2)
    fine = cfg.conv(256, 3)
    cfg.section("maxpool", size=2, stride=2)
    cfg.conv(512, 3)
    cfg.section("maxpool", size=2, stride=1)
    cfg.conv(1024, 3)
    cfg.conv(256, 1)
    cfg.conv(512, 3)
    cfg.head((3, 4, 5))
    cfg.upward(4, 128, fine)
    cfg.conv(256, 3)
    cfg.head((0, 1, 2))
    return cfg.text


def yolov3_small(width: int, height: int, classes: int, anchors: Anchors) -> str:
    """The ``.cfg`` of YOLOv3 with a quarter of its channels, one residual block per stage, nine anchors."""
    cfg = CfgWriter(width, height, classes, anchors)
    cfg.conv(16, 3, 2)
    cfg.conv(32, 3, 2)
    cfg.pyramid(((64, 1), (128, 1), (256, 1)), (128, 64, 32), 1)
    return cfg.text
