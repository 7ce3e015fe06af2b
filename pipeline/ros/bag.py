"""Writes a ROS 2 bag: a folder with metadata.yaml and an MCAP file, for ``ros2 bag play`` and Foxglove."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal

from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from pipeline.errors import InputError
from pipeline.ros.messages import STORE, Message, type_of

VERSION: Literal[9] = 9  # Of the format: that of Jazzy
LATCHED = ("/tf_static", "/map", "/camera/color/camera_info", "/camera/depth/camera_info", "/camera/transform")
"""Topics whose last message is also delivered to listeners that join later."""
FOREVER = QosTime(2147483647, 4294967295)  # ROS's value for no limit


class Bag(ExitStack):
    """Writes messages until it is closed."""

    def __init__(self, path: Path):
        """Begin a bag in a new folder.

        Raises:
            InputError: the folder exists already, or cannot be written; later calls raise it too.
        """
        super().__init__()
        self.path = path
        self._connections: dict[str, Connection] = {}
        with self._writing():
            self._writer = Writer(path, version=VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        self.callback(self._finish)

    def write(self, topic: str, time: float, message: Message) -> None:
        """Add a message that was sent at a time in s."""
        name = type_of(message)
        with self._writing():
            if topic not in self._connections:
                self._connections[topic] = self._writer.add_connection(
                    topic, name, typestore=STORE, offered_qos_profiles=[_qos(topic in LATCHED)]
                )
            self._writer.write(self._connections[topic], round(time * 1e9), STORE.serialize_cdr(message, name))

    def _finish(self) -> None:
        with self._writing():
            self._writer.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except WriterError as error:
            raise InputError(f"{self.path}: already there") from error
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror or error}") from error


def _qos(is_latched: bool) -> Qos:
    durability = QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE
    return Qos(
        QosHistory.KEEP_LAST,
        1 if is_latched else 10,
        QosReliability.RELIABLE,
        durability,
        FOREVER,
        FOREVER,
        QosLiveliness.AUTOMATIC,
        FOREVER,
        False,
    )
