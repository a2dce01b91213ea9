"""Rendered views under difficulties: the share of the visible corners that OpenCV finds.

    KEEP=FOLDER VIEWS=200 KINDS=chessboard,charuco,circle-grid cargo test --release --test detect study_of_board_views -- --ignored --nocapture
    python benches/board_views.py FOLDER

The first line draws the views, puts down what is in view of each, and prints what `robotcal` finds; the second prints the same of OpenCV.
The boards are those of tests/detect/board_views.rs. A corner is found where OpenCV has one within 2 px; ids count for ChArUco alone, whose corners
have them, and OpenCV's order of the others is not judged.
"""

import collections
import csv
import pathlib
import sys

import cv2
import numpy as np

FOUND_PX = 2.0


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


def tally(paths, detect):
    """Views, views with the board, in view, found, wrong ids, squares in px^2."""
    of_view = np.zeros(6)
    for path in paths:
        truth = {int(i): np.array([float(u), float(v)]) for i, u, v in csv.reader(open(path.with_suffix(".csv")))}
        corners, ids = detect(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
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
    cv2.setNumThreads(1)
    print("| board | view | views | with the board | in view | found | share | wrong | rms px |\n|---|---|---|---|---|---|---|---|---|")
    detectors = {"chessboard": chessboard, "charuco": charuco(), "circle-grid": circle_grid}
    for kind, detect in detectors.items():
        by_hard = collections.defaultdict(list)
        for path in sorted((pathlib.Path(sys.argv[1]) / kind).glob("*.png")):
            by_hard[path.stem.rsplit("-", 1)[0]].append(path)
        for hard, paths in by_hard.items():
            views, seen, in_view, found, wrong, squares = tally(paths, detect)
            rms = (squares / (2 * max(found, 1))) ** 0.5
            wrong = int(wrong) if kind == "charuco" else "-"
            print(
                f"| {kind} | {hard} | {views:.0f} | {seen:.0f} | {in_view:.0f} | {found:.0f} | {100 * found / in_view:.2f} % | {wrong} | {rms:.4f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
