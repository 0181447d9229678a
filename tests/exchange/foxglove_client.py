"""A viewer: speaks the Foxglove websocket protocol and decodes by the schemas it is told."""

import base64
import json
import struct
import threading
import time

import pytest

pytest.importorskip("foxglove", reason="without the extra [live] there is no live view")
connect = pytest.importorskip("websockets.sync.client").connect
pytest.importorskip("google.protobuf")

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory  # noqa: E402

TIME, MESSAGE = 2, 1


def message_class(schema_name, schema):
    """The class that a schema describes: a protobuf FileDescriptorSet in base64."""
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(schema))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema_name))


class Viewer:
    """Subscribes to everything; `messages` are (topic, stamp_ns, message), `clock` the times."""

    def __init__(self, port, patience_s=60.0):
        self.channels, self.messages, self.clock = {}, [], []
        self._port, self._patience_s = port, patience_s
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def end(self):
        """Wait until the server has gone."""
        self._thread.join(self._patience_s)
        assert not self._thread.is_alive()

    def of(self, topic):
        return [message for name, _, message in self.messages if name == topic]

    def _connected(self):
        end = time.monotonic() + self._patience_s
        while True:
            try:
                address = f"ws://127.0.0.1:{self._port}"
                return connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None)
            except OSError:
                assert time.monotonic() < end, "nobody serves"
                time.sleep(0.02)

    def _look(self):
        classes = {}
        with self._connected() as socket:
            for data in socket:
                if isinstance(data, str):
                    self._hear(json.loads(data), classes, socket)
                elif data[0] == TIME:
                    self.clock.append(struct.unpack_from("<Q", data, 1)[0])
                elif data[0] == MESSAGE:
                    number, stamp = struct.unpack_from("<IQ", data, 1)
                    message = classes[number].FromString(data[13:])
                    self.messages.append((self.channels[number]["topic"], stamp, message))

    def _hear(self, told, classes, socket):
        if told["op"] != "advertise":
            return
        for channel in told["channels"]:
            self.channels[channel["id"]] = channel
            classes[channel["id"]] = message_class(channel["schemaName"], channel["schema"])
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in told["channels"]]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
