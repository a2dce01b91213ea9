#!/usr/bin/env python3
"""Forward kinematics and projections by other libraries, which tests/independent.rs compares with.

    pip install numpy opencv-python-headless pytransform3d pyyaml
    python tests/independent/make.py

Kinematics: pytransform3d reads calibrated.urdf, which the program wrote (reports/kr6_small), and two robots of robots/.
Projections: OpenCV reads the values of a camera.yaml (plumb_bob, rational_polynomial: cv2.projectPoints; equidistant: cv2.fisheye).
"""

import csv
import pathlib

import cv2
import numpy as np
from pytransform3d.urdf import UrdfTransformManager

HERE = pathlib.Path(__file__).parent
ROOT = HERE.parent.parent
ROBOTS = [
    ("tests/independent/calibrated.urdf", "base_link", "tool0"),
    ("robots/ur10e/ur10e.urdf", "base_link", "tool0"),
    ("robots/lbr_iiwa_14/lbr_iiwa_14.urdf", "base_link", "flange"),
]
CAMERAS = {
    "plumb_bob": [-0.11, 0.09, 4e-4, -3e-4, -0.02],
    "rational_polynomial": [0.42, 0.06, 3e-4, -2e-4, 0.002, 0.78, 0.18, 0.012],
    "equidistant": [0.03, -0.015, 0.006, -0.002],
}
PINHOLE = (1108.5, 1109.0, 647.2, 507.4)


def kinematics(writer, rng):
    for path, base, tip in ROBOTS:
        robot = UrdfTransformManager()
        robot.load_urdf((ROOT / path).read_text())
        moving = [j for j, v in robot._joints.items() if v[5] in ("revolute", "continuous", "prismatic")]
        for _ in range(8):
            q = {j: rng.uniform(*np.clip(robot.get_joint_limits(j), -3.1, 3.1)) for j in moving}
            for joint, value in q.items():
                robot.set_joint(joint, value)
            pose = robot.get_transform(tip, base)
            joints = ";".join(f"{j}={q[j]!r}" for j in moving)
            writer.writerow([path, base, tip, joints] + [repr(float(v)) for v in pose[:3].flatten()])


def projections(writer, rng):
    fx, fy, cx, cy = PINHOLE
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    for model, d in CAMERAS.items():
        x = np.column_stack([rng.uniform(-0.4, 0.4, 20), rng.uniform(-0.3, 0.3, 20), rng.uniform(0.5, 1.5, 20)])
        project = cv2.fisheye.projectPoints if model == "equidistant" else cv2.projectPoints
        uv = project(x.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), k, np.array(d))[0].reshape(-1, 2)
        for point, image in zip(x, uv):
            writer.writerow([model] + [repr(float(v)) for v in (*PINHOLE, *point, *image)] + [";".join(map(repr, d))])


def main():
    rng = np.random.default_rng(7)
    with open(HERE / "kinematics.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["urdf", "base", "tip", "joints"] + [f"m{r}{c}" for r in range(3) for c in range(4)])
        kinematics(writer, rng)
    with open(HERE / "projections.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["model", "fx", "fy", "cx", "cy", "x_m", "y_m", "z_m", "u", "v", "d"])
        projections(writer, rng)


if __name__ == "__main__":
    main()
