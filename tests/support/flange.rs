//! The flange of a solution, and where its plate truly is.

use robotcal::assess::{FlangeModel, Limits};
use robotcal::fit::Fit;
use robotcal::geom::{Pose, rigid_fit};
use robotcal::simulate::SimulatedSeries;

/// The model of the flange of a fit.
pub fn flange_of(fit: &Fit) -> FlangeModel<'_> {
    FlangeModel::of(fit, &fit.covariance.reduced, &Limits::default()).unwrap()
}

/// From the frame of the first plate, as it was fitted, to that of its true markers: a bent plate takes the frame along that its markers are
/// given in.
pub fn true_from_fitted(fit: &Fit, made: &SimulatedSeries) -> Pose {
    let markers = made.true_plate.markers.iter().enumerate();
    let pairs: Vec<_> = markers.map(|(k, m)| (fit.state.plates[0].position(k), m.position_m)).collect();
    rigid_fit(&pairs).unwrap()
}
