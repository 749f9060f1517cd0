"""Schemas of Protobuf messages in the form that files and viewers take: with all that they import."""

from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet


def schema_data(descriptor: Any) -> bytes:
    """Return the schema of a message as a serialised FileDescriptorSet; it needs no other file.

    Args:
        descriptor: of the message.
    """
    files = FileDescriptorSet()
    _add_file(files, descriptor.file, set())
    return files.SerializeToString(deterministic=True)


def _add_file(files: FileDescriptorSet, file: Any, known: set[str]) -> None:
    """Add the descriptor of a .proto file after those of its imports: the schema is self-contained."""
    if file.name in known:
        return
    known.add(file.name)
    for dependency in file.dependencies:
        _add_file(files, dependency, known)
    file.CopyToProto(files.file.add())
