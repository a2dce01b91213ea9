#!/bin/sh
# Makes the pictures of the page "Good and bad series" anew with the program.
set -eu
cd "$(dirname "$0")/../../.."
cargo build --release --quiet --bin robotcal
robotcal=$PWD/target/release/robotcal
kr6=robots/kuka_kr6_r900/kuka_kr6_r900.urdf
here=src/guide/pictures
made=$(mktemp -d)

$robotcal plate --shape 10x8 --out "$made/plate" >/dev/null
echo 'coma_px = 3.0' >"$made/coma.toml"
simulate() {
    name=$1
    shift
    $robotcal simulate --urdf $kr6 --plate "$made/plate/plate.toml" --held-out 0 --seed 7 --out "$made/$name" "$@" >/dev/null
}
# The figure `$2` of the report on series `$1` becomes the picture `$3`. The gate fails on most of them: exit code 1.
picture() {
    [ -e "$made/$1-result" ] || $robotcal identify --urdf $kr6 --series "$made/$1" --out "$made/$1-result" --quiet >/dev/null || [ $? = 1 ]
    $robotcal show "$made/$1-result/solution.json" --figures "$made/$1-figures" >/dev/null || [ $? = 1 ]
    cp "$made/$1-figures/$2.svg" "$here/$3.svg"
}

stops="--images 30 --observations --outer-only"
close="--images 10 --width-px 960 --height-px 720 --near-m 0.15 --far-m 0.3 --least-markers 25"
# shellcheck disable=SC2086
{
    simulate good $stops
    simulate lens $stops --lens parallax
    simulate drift $stops --fault drifting-camera
    simulate loose $stops --fault loose-camera
    simulate moved $stops --fault moved-plate
    simulate moving $stops --fault moving-robot
    simulate few --images 9 --observations --outer-only
    simulate coma $close --conditions "$made/coma.toml"
}
picture good pose-residuals-1 good-poses
picture good residuals-1 good-residuals
picture good coverage-1 good-coverage
picture drift pose-residuals-1 drift
picture loose pose-residuals-1 loose
picture moved images moved
picture moving images moving
picture lens residuals-1 lens
picture coma residuals-1 coma
picture few coverage-1 few
rm -r "$made"
