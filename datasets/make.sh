#!/bin/sh
# Makes the series of this folder anew with the program. ur10e_observations stays: its version of the program drew other errors (README.md).
set -eu
cd "$(dirname "$0")/.."
cargo build --release --quiet --bin robotcal
robotcal=target/release/robotcal
kr6=robots/kuka_kr6_r900/kuka_kr6_r900.urdf

rm -rf datasets/kr6_small
$robotcal simulate --urdf $kr6 --out datasets/kr6_small --images 24 --seed 1

rm -rf datasets/bad/*/
plate=$(mktemp -d)
$robotcal plate --shape 10x8 --out "$plate" >/dev/null
for fault in $($robotcal simulate --urdf $kr6 --out none --fault list); do
    case $fault in
    missing-image* | unreadable-image | image-of-other-size | no-markers)
        # Small pictures of few stops, nearly without noise, to keep the files small.
        content="--images 8 --width-px 480 --height-px 360 --near-m 0.15 --far-m 0.3 --least-markers 25 --conditions datasets/bad/conditions.toml" ;;
    *) content="--images 30 --observations --outer-only" ;;
    esac
    # shellcheck disable=SC2086
    $robotcal simulate --urdf $kr6 --plate "$plate/plate.toml" --out "datasets/bad/$fault" --held-out 0 --seed 7 $content --fault "$fault" >/dev/null
done
rm -r "$plate"
du -sh datasets
