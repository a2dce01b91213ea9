"""Rendered views under difficulties: the share of the visible corners that `robotcal` and OpenCV find in the same pictures.

    KEEP=FOLDER FROM=300000 VIEWS=200 KINDS=chessboard,charuco,circle-grid cargo test --release --test detect study_of_board_views -- --ignored --nocapture
    python benches/board_views.py FOLDER [ROBOTCAL]

The first line draws the views and puts down what is in view of each; the second prints what is found of that. The boards are those of
tests/detect/board_views.rs. OpenCV sees one image at a time; ROBOTCAL, the program, once one image at a time and once all of a kind as a series. A
corner is found where there is one within 2 px, with its id; OpenCV's order of chessboards and dots is not judged.
"""

import collections
import csv
import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np

import made_with

FOUND_PX = 2.0
PLATES = {
    "chessboard": "columns = 9\nrows = 6\npitch_m = 0.025",
    "charuco": 'columns = 8\nrows = 6\npitch_m = 0.03\naruco = { dictionary = "DICT_4X4_50", side_m = 0.0225 }',
    "circle-grid": "columns = 10\nrows = 8\npitch_m = 0.025\nradius_m = 0.006\nlarge = [[1, 0]]",
}


def charuco():
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    detector = cv2.aruco.CharucoDetector(cv2.aruco.CharucoBoard((9, 7), 0.03, 0.0225, dictionary))

    def detect(grey):
        corners, ids, _, _ = detector.detectBoard(grey)
        return ([], None) if ids is None else (corners, [int(i) for i in np.ravel(ids)])

    return detect


def chessboard(grey):
    found, corners = cv2.findChessboardCornersSB(grey, (9, 6), flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY)
    return (corners if found else [], None)


def circle_grid(grey):
    found, centres = cv2.findCirclesGrid(grey, (10, 8), flags=cv2.CALIB_CB_SYMMETRIC_GRID)
    return (centres if found else [], None)


def of_opencv(paths, detect):
    """Places and ids by view; no ids where OpenCV has none."""
    return {path.stem: detect(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for path in paths}


def of_robotcal(program, kind, paths, together):
    """Places and ids by view, of images one by one or of all as a series."""
    found = collections.defaultdict(lambda: ([], []))
    with tempfile.TemporaryDirectory() as folder:
        plate, out = pathlib.Path(folder) / "plate.toml", pathlib.Path(folder) / "out"
        plate.write_text(f'format = 1\nkind = "{kind}"\n{PLATES[kind]}\n')
        for images in [paths] if together else [[path] for path in paths]:
            for old in out.glob("*"):
                old.unlink()
            subprocess.run([program, "detect", "--plate", plate, "--out", out, *images], capture_output=True)
            seen = out / "observations.csv"
            for row in csv.DictReader(open(seen)) if seen.is_file() else ():
                places, ids = found[pathlib.Path(row["image"]).stem]
                places.append((float(row["u"]), float(row["v"])))
                ids.append(int(row["marker"]))
    return found


def tally(paths, found):
    """Views, views with the board, in view, found, wrong ids, squares in px^2."""
    of_view = np.zeros(6)
    for path in paths:
        truth = {int(i): np.array([float(u), float(v)]) for i, u, v in csv.reader(open(path.with_suffix(".csv")))}
        corners, ids = found[path.stem]
        places = np.reshape(corners, (-1, 2))
        of_view[:3] += 1, len(places) > 0, len(truth)
        for marker, at in truth.items() if len(places) else ():
            if ids is None:
                off = np.linalg.norm(places - at, axis=1).min()
            elif marker in ids:
                off = np.linalg.norm(places[ids.index(marker)] - at)
                of_view[4] += off > FOUND_PX
            else:
                continue
            if off <= FOUND_PX:
                of_view[3] += 1
                of_view[5] += off * off
    return of_view


def main():
    made_with.say(sys.argv[2] if len(sys.argv) > 2 else None)
    cv2.setNumThreads(1)
    print("| board | view | detector | views with the board | found | share | wrong | rms px |\n|---|---|---|---|---|---|---|---|")
    detectors = {"chessboard": chessboard, "charuco": charuco(), "circle-grid": circle_grid}
    for kind, detect in detectors.items():
        by_hard = collections.defaultdict(list)
        for path in sorted((pathlib.Path(sys.argv[1]) / kind).glob("*.png")):
            by_hard[path.stem.rsplit("-", 1)[0]].append(path)
        everything = sum(by_hard.values(), [])
        series = of_robotcal(sys.argv[2], kind, everything, True) if len(sys.argv) > 2 else None
        for hard, paths in by_hard.items():
            found = {"OpenCV": of_opencv(paths, detect)}
            if series is not None:
                found |= {"robotcal": of_robotcal(sys.argv[2], kind, paths, False), "robotcal, series": series}
            for name, of_name in found.items():
                views, seen, in_view, right, wrong, squares = tally(paths, of_name)
                rms = (squares / (2 * max(right, 1))) ** 0.5
                wrong = "-" if name == "OpenCV" and kind != "charuco" else int(wrong)
                print(
                    f"| {kind} | {hard} | {name} | {seen:.0f} of {views:.0f} | {right:.0f} of {in_view:.0f} | {100 * right / in_view:.2f} % | {wrong} | {rms:.4f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
