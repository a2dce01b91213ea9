"""Hand-eye calibration from poses of a controller: robotcal beside OpenCV's five solvers, on the same corners and the same folds.

    python benches/hand_eye.py ROBOTCAL SERIES [FOLDS]

Needs opencv-python-headless<5 and numpy. Markers are those that robotcal finds; OpenCV has its own intrinsics (calibrateCamera, on the
images of the fold), its own poses (solvePnP) and the mean of A X C as target pose. The error is the same for all: in every image that was held
out, the distance between where the image alone puts the markers (solvePnP with the intrinsics of the method) and where the controller's pose
puts them, root mean square over markers and images.
"""

import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import tomllib

import cv2
import numpy as np

import made_with

SOLVERS = {
    "Tsai": cv2.CALIB_HAND_EYE_TSAI,
    "Park": cv2.CALIB_HAND_EYE_PARK,
    "Horaud": cv2.CALIB_HAND_EYE_HORAUD,
    "Andreff": cv2.CALIB_HAND_EYE_ANDREFF,
    "Daniilidis": cv2.CALIB_HAND_EYE_DANIILIDIS,
}


def pose(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, np.ravel(translation)
    return matrix


def of_quaternion(q):
    x, y, z, w = np.array(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def mean_pose(poses):
    u, _, v = np.linalg.svd(sum(p[:3, :3] for p in poses))
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    return pose(rotation, np.mean([p[:3, 3] for p in poses], axis=0))


def controller(series):
    rows = csv.DictReader((series / "controller.csv").open())
    numbers = lambda row, names: [float(row[n]) for n in names]
    return {
        row["image"]: pose(of_quaternion(numbers(row, ("qx", "qy", "qz", "qw"))), numbers(row, ("x_m", "y_m", "z_m")))
        for row in rows
    }


def corners(robotcal, series, folder):
    """Corners of every image: marker positions in the plate frame, pixels."""
    subprocess.run([robotcal, "detect", "--series", series, "--out", folder / "seen"], check=True, stdout=subprocess.DEVNULL)
    plate = plate_of(series)
    found = {}
    for row in csv.DictReader((folder / "seen" / "observations.csv").open()):
        at, uv = found.setdefault(row["image"], ([], []))
        at.append(plate[int(row["marker"])])
        uv.append([float(row["u"]), float(row["v"])])
    return {name: (np.array(at), np.array(uv)) for name, (at, uv) in found.items()}


def plate_of(series):
    """Markers of a lattice: ids row by row from the top-left, x right, y up."""
    plate = tomllib.loads((series / "plate.toml").read_text())
    columns, rows, pitch = plate["columns"], plate["rows"], plate["pitch_m"]
    middle = (columns - 1) / 2, (rows - 1) / 2
    return [[(k % columns - middle[0]) * pitch, (middle[1] - k // columns) * pitch, 0.0] for k in range(columns * rows)]


def seen_pose(found, camera, distortion):
    _, rotation, translation = cv2.solvePnP(*found, camera, distortion)
    return pose(cv2.Rodrigues(rotation)[0], translation)


def squares(found, camera, distortion, predicted):
    seen = seen_pose(found, camera, distortion)
    at = np.c_[found[0], np.ones(len(found[0]))].T
    return ((predicted @ at - seen @ at)[:3] ** 2).sum(axis=0)


def of_opencv(images, flange, seen, size):
    """Intrinsics by OpenCV, then hand-eye transform and target pose by each solver."""
    points = [seen[i][0].astype(np.float32) for i in images]
    pixels = [seen[i][1].astype(np.float32) for i in images]
    _, camera, distortion, rotations, translations = cv2.calibrateCamera(points, pixels, size, None, None)
    views = [pose(cv2.Rodrigues(r)[0], t) for r, t in zip(rotations, translations)]
    for name, solver in SOLVERS.items():
        x = pose(
            *cv2.calibrateHandEye(
                [flange[i][:3, :3] for i in images],
                [flange[i][:3, 3] for i in images],
                [v[:3, :3] for v in views],
                [v[:3, 3] for v in views],
                method=solver,
            )
        )
        plate = mean_pose([flange[i] @ x @ v for i, v in zip(images, views)])
        yield name, camera, distortion, x, plate


def of_robotcal(robotcal, series, images, folder):
    """One command on a series of these images alone."""
    run, out = folder / "fold", folder / "result"
    for old in (run, out):
        shutil.rmtree(old, ignore_errors=True)
    run.mkdir()
    for file in ("plate.toml", "plate.csv", "series.toml"):
        if (series / file).exists():
            shutil.copy(series / file, run)
    (run / "images").mkdir()
    lines = (series / "controller.csv").read_text().splitlines()
    kept = [line for line in lines[1:] if line.split(",")[0] in images]
    (run / "controller.csv").write_text("\n".join([lines[0], *kept]) + "\n")
    for image in images:
        shutil.copy(series / "images" / image, run / "images")
    done = subprocess.run([robotcal, "identify", "--series", run, "--out", out], stdout=subprocess.DEVNULL)
    if done.returncode > 1:
        raise SystemExit(f"robotcal ended with {done.returncode}")
    camera = numbers_of(out / "camera.yaml")
    intrinsics = np.reshape(camera["camera_matrix"], (3, 3))
    transform = lambda file: pose(of_quaternion(numbers_of(out / file)["quat_xyzw"]), numbers_of(out / file)["xyz_m"])
    return intrinsics, np.array(camera["distortion_coefficients"]), transform("hand_camera.yaml"), transform("plate_pose.yaml")


def numbers_of(file):
    """Lists of numbers in a flat YAML file, by key; `data` counts as the key above it."""
    found, above = {}, None
    for line in file.read_text().splitlines():
        key, _, value = line.partition(":")
        name, value = key.strip(), value.strip()
        if value.startswith("["):
            found[above if name == "data" else name] = json.loads(value)
        elif not value:
            above = name
    return found


def main():
    robotcal, series = sys.argv[1], pathlib.Path(sys.argv[2])
    made_with.say(robotcal)
    folds = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    flange = controller(series)
    errors = {}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        seen = corners(robotcal, series, folder)
        first = cv2.imread(str(series / "images" / next(iter(seen))))
        names = sorted(seen)
        for k in range(folds):
            held, images = names[k::folds], [n for i, n in enumerate(names) if i % folds != k]
            results = list(of_opencv(images, flange, seen, first.shape[1::-1]))
            results.append(("robotcal", *of_robotcal(robotcal, series, images, folder)))
            for name, camera, distortion, x, plate in results:
                for image in held:
                    predicted = np.linalg.inv(flange[image] @ x) @ plate
                    errors.setdefault(name, []).append(squares(seen[image], camera, distortion, predicted))
    print(f"| method | held out, mm ({len(names)} images, {folds} folds) |\n|---|---|")
    for name, squared in errors.items():
        print(f"| {name} | {1e3 * np.sqrt(np.mean(np.concatenate(squared))):.3f} |")


main()
