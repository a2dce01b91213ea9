#!/usr/bin/env bash
# Boards on real photographs: `robotcal detect` beside OpenCV, same pictures, one thread each, in one run.
#
#   PYTHON=venv/bin/python benches/boards.sh SERIES [SERIES ...]
#
# SERIES are series folders with images/ and a plate.toml (chessboard, charuco or circle-grid); PYTHON needs numpy and OpenCV 4.8 or
# later. Printed a series and detector: images with the complete board, corners, the judge (rms in px of OpenCV's calibrateCamera on the
# corners and images that all detectors of the row have in common), labels that contradict OpenCV's order, and the CPU time of an image
# with its reading. BINARY: the program (default: target/release/robotcal, built first).
set -euo pipefail
[ $# -ge 1 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0"; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 RAYON_NUM_THREADS=1 CARGO_TERM_COLOR=never
if [ -z "${BINARY:-}" ]; then
  (cd "$here/.." && cargo build --release -q)
  BINARY="$here/../target/release/robotcal"
fi
"$here/made_with.sh" "$BINARY"
exec "$python" "$here/boards.py" "$BINARY" "$@"
