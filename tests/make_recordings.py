#!/usr/bin/env python3
"""Writes tests/recordings: small rosbag2 and MCAP recordings by writers that know nothing of this project.

    python3 -m venv venv && venv/bin/pip install rosbags mcap-ros2-support numpy pillow
    venv/bin/python tests/make_recordings.py tests/recordings

The robot visits five stops for one second each and takes half a second between them; joints are sampled at 100 Hz,
images at 10 Hz. tests/readers_mcap.rs knows the same formulas.
"""

import dataclasses
import io
import pathlib
import shutil
import sys

import numpy as np
from PIL import Image as Picture
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

START = 1_700_000_000 * 10**9
WIDTH, HEIGHT, STOPS = 32, 24, 5
SECOND = 10**9
store = get_typestore(Stores.ROS2_HUMBLE)
Msg = store.types


def posture(stop):
    return np.array([0.1 * stop, 0.5 - 0.2 * stop, 0.25 * (-1) ** stop])


def joints(t):
    """Positions at t s: one second at a stop, half a second to the next."""
    stop, inside = int(t // 1.5), t % 1.5
    if stop >= STOPS - 1:
        return posture(STOPS - 1)
    share = max(0.0, inside - 1.0) / 0.5
    return (1 - share) * posture(stop) + share * posture(stop + 1)


def picture(stop, shot):
    """Grey counts of 8 bits; shot 4 of a stop has the most contrast."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    pattern = (7 * x + 13 * y + 29 * stop + x * y) % 201
    return (pattern if shot == 4 else 50 + pattern // 2).astype(np.uint8)


def header(stamp, frame="camera"):
    time = Msg["builtin_interfaces/msg/Time"](stamp // SECOND, stamp % SECOND)
    return Msg["std_msgs/msg/Header"](time, frame)


def joint_state(stamp, t, extra=True):
    names, q = ["joint_1", "joint_2", "joint_3"], joints(t)
    if extra:
        names, q = ["gripper", *names], np.array([0.04, *q])
    empty = np.array([], dtype=np.float64)
    return Msg["sensor_msgs/msg/JointState"](header(stamp, ""), names, q, empty, empty)


def image(stamp, data, encoding, step, big_endian=0):
    raw = np.frombuffer(data, dtype=np.uint8)
    return Msg["sensor_msgs/msg/Image"](header(stamp), HEIGHT, WIDTH, encoding, big_endian, step, raw)


def camera_info(stamp):
    roi = Msg["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.array([40.0, 0, 15.5, 0, 41.0, 11.5, 0, 0, 1])
    p = np.array([40.0, 0, 15.5, 0, 0, 41.0, 11.5, 0, 0, 0, 1, 0])
    d = np.array([-0.1, 0.05, 0.0, 0.0, 0.0])
    return Msg["sensor_msgs/msg/CameraInfo"](header(stamp), HEIGHT, WIDTH, "plumb_bob", d, k, np.eye(3).ravel(), p, 0, 0, roi)


def events():
    """(time of recording, kind, stamp, t, stop, shot); images are recorded 30 ms after their stamp."""
    rows = []
    for i in range(STOPS * 150 - 49):
        stamp = START + i * SECOND // 100
        rows.append((stamp + 1_000_000, "joints", stamp, i / 100, 0, 0))
    for i in range(STOPS * 15 - 5):
        # 5 ms between two joint samples
        stamp = START + i * SECOND // 10 + 5_000_000
        rows.append((stamp + 30_000_000, "image", stamp, i / 10, i // 15, i % 15))
    return sorted(rows)


def rosbag2(path, encode, little_endian=True, compression=None, storage=StoragePlugin.MCAP):
    shutil.rmtree(path, ignore_errors=True)
    writer = Bag2Writer(path, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        js = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        im = writer.add_connection("/camera/image_raw", "sensor_msgs/msg/Image", typestore=store)
        other = writer.add_connection("/note", "std_msgs/msg/String", typestore=store)
        note = Msg["std_msgs/msg/String"]("nothing to see")
        writer.write(other, START, store.serialize_cdr(note, "std_msgs/msg/String", little_endian=little_endian))
        for log, kind, stamp, t, stop, shot in events():
            if kind == "joints":
                message, name, connection = joint_state(stamp, t), "sensor_msgs/msg/JointState", js
            else:
                message, name, connection = encode(stamp, stop, shot), "sensor_msgs/msg/Image", im
            writer.write(connection, log, store.serialize_cdr(message, name, little_endian=little_endian))


def mono8(stamp, stop, shot):
    return image(stamp, picture(stop, shot).tobytes(), "mono8", WIDTH)


def bayer16(stamp, stop, shot):
    """16 bits in the byte order of big machines, rows padded by 6 bytes; red, green and blue are 200, 100 and 50 times the counts."""
    grey = picture(stop, shot).astype(np.uint16)
    gain = np.full((HEIGHT, WIDTH), 100, np.uint16)
    gain[0::2, 0::2], gain[1::2, 1::2] = 200, 50
    rows = np.pad((grey * gain).astype(">u2"), ((0, 0), (0, 3)))
    return image(stamp, rows.tobytes(), "bayer_rggb16", 2 * (WIDTH + 3), 1)


def ros2_support(path, compression):
    """Compressed chunks; png and jpeg as CompressedImage, a camera info; the gripper has its own publisher."""
    with open(path, "wb") as file:
        writer = Ros2Writer(file, chunk_size=16384, compression=compression)
        js = writer.register_msgdef("sensor_msgs/msg/JointState", definition("sensor_msgs/msg/JointState"))
        ci = writer.register_msgdef("sensor_msgs/msg/CompressedImage", definition("sensor_msgs/msg/CompressedImage"))
        info = writer.register_msgdef("sensor_msgs/msg/CameraInfo", definition("sensor_msgs/msg/CameraInfo"))
        writer.write_message("/camera/camera_info", info, plain(camera_info(START)), START, START)
        for log, kind, stamp, t, stop, shot in events():
            if kind == "joints":
                writer.write_message("/joint_states", js, plain(joint_state(stamp, t, extra=False)), log, stamp)
                continue
            buffer = io.BytesIO()
            form = "png" if stop < 4 else "jpeg"
            Picture.fromarray(picture(stop, shot)).save(buffer, form.upper())
            message = Msg["sensor_msgs/msg/CompressedImage"](header(stamp), f"mono8; {form} compressed", np.frombuffer(buffer.getvalue(), np.uint8))
            writer.write_message("/camera/image_raw/compressed", ci, plain(message), log, stamp)
        writer.finish()


def plain(value):
    """A message as dictionaries and lists, as mcap-ros2-support wants it."""
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value) if f.name != "__msgtype__"}
    return value.tolist() if isinstance(value, np.ndarray) else value


def definition(name):
    """Message definition with all its parts, as rosbag2 stores it."""
    return store.generate_msgdef(name, ros_version=2)[0]


def others(folder):
    """A ROS 1 bag, which is to be refused with advice."""
    (folder / "old.bag").unlink(missing_ok=True)
    store1 = get_typestore(Stores.ROS1_NOETIC)
    with Bag1Writer(folder / "old.bag") as writer:
        connection = writer.add_connection("/note", "std_msgs/msg/String", typestore=store1)
        note = store1.types["std_msgs/msg/String"]("old")
        writer.write(connection, START, store1.serialize_ros1(note, "std_msgs/msg/String"))


if __name__ == "__main__":
    target = pathlib.Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    rosbag2(target / "mono8", mono8)
    rosbag2(target / "sqlite", mono8, storage=StoragePlugin.SQLITE3)
    rosbag2(target / "bayer16_big_endian", bayer16, little_endian=False)
    rosbag2(target / "zipped_messages", mono8, compression=CompressionMode.MESSAGE)
    ros2_support(target / "lz4.mcap", CompressionType.LZ4)
    ros2_support(target / "zstd.mcap", CompressionType.ZSTD)
    others(target)
