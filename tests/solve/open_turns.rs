//! Images of a grid of dots that hide its larger dot: the readings tell how it is turned, or the image stays left out.

use std::path::Path;

use robotcal::error::Code;
use robotcal::identify::{Options, RobotModel, identify};
use robotcal::problem::{Image, ImageRejection, MeasuredSeries};
use robotcal::series::{Plate, PlateKind};
use robotcal::simulate::{WorldRequest, series};
use robotcal::study::measured;
use robotcal::urdf::Chain;

const PITCH_M: f64 = 0.025;

/// A grid whose first dot is larger.
fn grid(columns: u32, rows: u32) -> Plate {
    let mut plate = Plate::lattice(PlateKind::CircleGrid, columns, rows, PITCH_M, 0.1e-3);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.24 * PITCH_M);
    plate.markers[0].outer_radius_m = 0.4 * PITCH_M;
    plate
}

fn world(plate: Plate, seed: u64) -> (Chain, MeasuredSeries) {
    println!("seed {seed}");
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf");
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap();
    let request = WorldRequest { images: 24, seed, ..WorldRequest::typical(chain.clone(), plate) };
    let seen = measured(&series(&request).unwrap(), &chain);
    (chain, seen)
}

/// Hides the larger dot at a stop, with ids that are off by one of the turns.
fn hide(series: &mut MeasuredSeries, stop: usize, turn: usize) {
    let turns = series.plate.turns_of_places();
    let stop = &mut series.stops[stop];
    stop.observations.retain(|o| o.marker != 0);
    if let Some(turn) = turns.get(turn) {
        stop.observations.iter_mut().for_each(|o| o.marker = turn.id(o.marker));
    }
    stop.observations.sort_by_key(|o| (o.marker, o.edge));
    stop.left_out = Some(ImageRejection::Unusable { why: Code::PlateTurnOpen, what: String::new() });
}

/// The images that a fit used, each with the markers that it took them for.
fn used(chain: &Chain, series: &MeasuredSeries) -> Vec<(String, Vec<usize>)> {
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(chain.clone(), std::slice::from_ref(series), &options).unwrap();
    let markers = |image: &Image| image.observations.iter().map(|o| o.marker).collect();
    let images = solution.fit.problem.images.iter().filter(|image| image.rejected.is_none());
    images.map(|image| (image.name.clone(), markers(image))).collect()
}

#[test]
fn the_readings_tell_how_a_grid_is_turned_that_hides_its_larger_dot() {
    for (columns, rows, turns) in [(11, 8, 1), (9, 9, 3)] {
        let (chain, mut seen) = world(grid(columns, rows), 3);
        assert!(seen.plate.turns().is_empty() && seen.plate.turns_of_places().len() == turns);
        let open: Vec<usize> = (0..24).step_by(3).collect();
        let mut known = seen.clone();
        for (k, &stop) in open.iter().enumerate() {
            known.stops[stop].observations.retain(|o| o.marker != 0);
            hide(&mut seen, stop, k % (turns + 1));
        }
        // Readings of another stop tell no turn, and no readings do not either.
        seen.stops[open[1]].readings = seen.stops[open[1] + 1].readings.clone();
        seen.stops[open[2]].readings = None;
        let all = used(&chain, &known).into_iter().enumerate();
        let expected: Vec<_> = all.filter(|(k, _)| ![open[1], open[2]].contains(k)).map(|(_, image)| image).collect();
        assert_eq!(used(&chain, &seen), expected, "{columns} x {rows}");
    }
}

/// Where too few images show the larger dot, nothing tells the turn of the others.
#[test]
fn two_images_with_the_larger_dot_tell_no_turn() {
    let (chain, mut seen) = world(grid(9, 9), 4);
    (2..24).for_each(|stop| hide(&mut seen, stop, stop % 4));
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    assert!(identify(chain, &[seen], &options).is_err());
}
