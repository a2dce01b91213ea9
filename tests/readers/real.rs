//! Series and tables on measured data, where they are at hand.

use crate::robots::shared;
use robotcal::series::{PlateKind, Source, read};
use robotcal::urdf;

#[test]
#[ignore = "needs the real series"]
fn real_series_are_read_without_complaint() {
    let real = shared("real");
    for (name, pitch_m, camera) in [
        ("nachi-2025-01-17", 0.015, "photoneo"),
        ("nachi-2025-02-04", 0.015, "photoneo"),
        ("nachi-2025-02-19", 0.006, "photoneo"),
        ("aubo-2024-12-16", 0.01, "mecheye"),
    ] {
        let folder = real.join(name);
        let series = read(&folder).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((series.name.as_str(), series.mounting(), series.camera_name()), (name, name, camera));
        assert_eq!(series.notices, [], "{name}");
        assert!(matches!(series.source, Source::Images { .. }));
        assert_eq!((series.plate.kind, series.plate.markers.len()), (PlateKind::Chessboard, 88));
        assert_eq!(series.plate.pitch_m, pitch_m);
        let robot = urdf::read(&folder.join("robot.urdf")).unwrap();
        let chain = robot.chain(series.manifest.base.as_deref(), series.manifest.tip.as_deref()).unwrap();
        let readings = series.readings_for(&chain).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(readings.len(), 24);
        for (reading, stop) in readings.iter().zip(&series.stops.stops) {
            assert_eq!(reading, &stop.raw_readings, "radians stay as they are");
            assert!(stop.path.as_ref().is_some_and(|p| p.is_file()));
        }
        assert_eq!(series.reading_notices(&chain), [], "{name}");
        let hashes = series.image_hashes().unwrap();
        assert_eq!(hashes.len(), 24);
        assert_eq!(series.inputs.len(), 3);

        // The same numbers under the wrong unit are refused.
        let mut wrong = series.clone();
        wrong.manifest.joint_unit = Some(robotcal::series::AngleUnit::Deg);
        let error = wrong.readings_for(&chain).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert_eq!(error.code, robotcal::Code::RadiansAsDegrees, "{error}");
        let mut wrong = series.clone();
        for q in wrong.stops.stops.iter_mut().filter_map(|s| s.raw_readings.as_mut()).flatten() {
            *q = q.to_degrees();
        }
        let error = wrong.readings_for(&chain).unwrap_err();
        assert_eq!(error.code, robotcal::Code::DegreesAsRadians, "{error}");
    }
}
