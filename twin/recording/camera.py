"""Camera messages of an episode: pictures as `CompressedImage`."""

from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

CAMERA_TOPIC = "/camera/image"
"""Topic of the pictures."""


def picture_message(jpeg: bytes, nanoseconds: int) -> Any:
    """Return the `CompressedImage` message of one picture, in the frame `camera`.

    Args:
        jpeg: the picture, as a JPEG file.
        nanoseconds: time of the picture.
    """
    message = CompressedImage(data=jpeg, format="jpeg", frame_id="camera")
    message.timestamp.FromNanoseconds(nanoseconds)
    return message
