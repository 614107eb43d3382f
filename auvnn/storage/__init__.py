"""What is kept on disk: folders that are whole or absent, and tensors that cannot run code."""

from auvnn.storage.folders import folder_exists, read_folder, write_folder
from auvnn.storage.tensors import tensors_from_bytes, tensors_to_bytes

__all__ = ["folder_exists", "read_folder", "tensors_from_bytes", "tensors_to_bytes", "write_folder"]
