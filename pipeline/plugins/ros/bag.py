"""Write ROS 2 bags, which are folders with metadata.yaml and an MCAP file, for ``ros2 bag play`` and Foxglove."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from pipeline.datasets.message_types import STORE
from pipeline.datasets.messages import Message
from pipeline.errors import InputError
from pipeline.plugins.ros.messages import nanoseconds, type_of

LATCHED = ("/tf_static", "/map", "/camera/color/camera_info", "/camera/depth/camera_info", "/camera/transform")
"""Topics whose last message is also delivered to subscribers that join later."""


class Bag(ExitStack):
    """A ROS 2 bag to which messages are written until it is closed."""

    def __init__(self, path: Path):
        """Start a bag in a new folder.

        Raises:
            InputError: the folder already exists or cannot be written. The other methods also raise this error if
                writing fails.
        """
        super().__init__()
        self.path = path
        self._connections: dict[str, Connection] = {}
        with self._writing():
            self._writer = Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        self.callback(self._finish)

    def write(self, topic: str, time: float, message: Message) -> None:
        """Write a message that was sent at ``time``, s."""
        name = type_of(message)
        with self._writing():
            if topic not in self._connections:
                profiles = [_latched()] if topic in LATCHED else []
                self._connections[topic] = self._writer.add_connection(
                    topic, name, typestore=STORE, offered_qos_profiles=profiles
                )
            self._writer.write(self._connections[topic], nanoseconds(time), STORE.serialize_cdr(message, name))

    def _finish(self) -> None:
        with self._writing():
            self._writer.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except WriterError as error:
            raise InputError(f"{self.path}: already exists; choose another folder or delete this one") from error
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror or error}") from error


def _latched() -> Qos:
    """The quality of service of a topic whose last message is kept; other topics use ROS's default."""
    unlimited = QosTime(0, 0)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        unlimited,
        unlimited,
        QosLiveliness.AUTOMATIC,
        unlimited,
        False,
    )
