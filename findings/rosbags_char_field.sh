#!/usr/bin/env bash
# rosbags 0.11.9 and ROS 2 Jazzy: one topic with a char field makes AnyReader refuse the whole bag
#
# In a .msg file `char` is the old name of uint8. ROS 2 translates it when it makes the IDL, so that the type
# description and its hash (RIHS01) of std_msgs/msg/Char say uint8; rosbag2 writes these hashes into the metadata of
# a bag. rosbags keeps `char` as a type of its own and computes another hash, from its own store of the
# Jazzy types as from the text of the definition. AnyReader.open() compares the hashes of all types in a bag and raises
# for the first that differs: one topic with a char field anywhere in a type, and no topic of the bag can be read.
# The documentation does not mention it. The plain Reader, which compares nothing, reads the same bag; the bytes of a
# message are the same, as both types are one byte.
#
# Seen:
#   hash of std_msgs/msg/Char by ROS 2 Jazzy (std_msgs 5.3.6)   RIHS01_3ad2d04d...
#   hash of std_msgs/msg/Char by rosbags, Stores.ROS2_JAZZY     RIHS01_8914cecc...
#   all other types of std_msgs                                 equal
#   AnyReader on a bag of String and Char   AnyReaderError: Message type 'std_msgs/msg/Char' hash mismatch ...
#   Reader on the same bag                  both messages
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" && "$temp/venv/bin/pip" install -qq rosbags==0.11.9 numpy==2.2.6 &&
    "$temp/venv/bin/pip" install -qq --no-deps ros-std-msgs==5.3.6 || exit 2
"$temp/venv/bin/python" - "$temp" <<'PY'
import json
import sys
from pathlib import Path

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
SHARE = Path(sys.prefix) / "share"
temp = Path(sys.argv[1])


def hashes_of_ros():
    """Hashes as the generator of ROS 2 computed them, installed beside each message."""
    files = (SHARE / "std_msgs" / "msg").glob("*.json")
    entries = [json.loads(file.read_text())["type_hashes"][0] for file in files]
    return {entry["type_name"]: entry["hash_string"] for entry in entries}


ROS = hashes_of_ros()
other = sorted(name for name, rihs in ROS.items() if STORE.hash_rihs01(name) != rihs)
for name in other:
    print(f"{name}: ROS {ROS[name][:15]}..., rosbags {STORE.hash_rihs01(name)[:15]}...")
print(f"{len(ROS) - len(other)} other types: equal")

messages = {
    "std_msgs/msg/String": STORE.types["std_msgs/msg/String"](data="hello"),
    "std_msgs/msg/Char": STORE.types["std_msgs/msg/Char"](data=65),
}
with Writer(temp / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
    for stamp, (name, message) in enumerate(messages.items()):
        text = (SHARE / name).with_suffix(".msg").read_text()
        connection = writer.add_connection(f"/{stamp}", name, msgdef=text, rihs01=ROS[name])
        writer.write(connection, stamp, STORE.serialize_cdr(message, name))

error = ""
try:
    with AnyReader([temp / "bag"]) as reader:
        list(reader.messages())
except AnyReaderError as caught:
    error = str(caught)
print("AnyReader:", error or "reads the bag")
with Reader(temp / "bag") as reader:
    read = [STORE.deserialize_cdr(raw, c.msgtype).data for c, _, raw in reader.messages()]
print("Reader:", read)
as_stated = (
    other == ["std_msgs/msg/Char"] and len(ROS) > 20 and "hash mismatch" in error and "Char" in error
) and read == ["hello", 65]
sys.exit(0 if as_stated else 1)
PY
