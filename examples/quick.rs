//! quick
use nalgebra::{Vector2, Vector3, Vector6};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use robotcal::geom::Pose;
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::circle::centroid_uv;
use robotcal::model::mount::CameraMount;
use robotcal::model::robot::Robot;
use robotcal::recipe::*;
use robotcal::series::*;

fn main() {
    tracing_subscriber::fmt().with_max_level(tracing::Level::DEBUG).with_writer(std::io::stderr).init();
    let a: Vec<String> = std::env::args().collect();
    let seed: u64 = a[1].parse().unwrap();
    let sq: f64 = a[2].parse().unwrap();
    let n: usize = a[3].parse().unwrap();
    let model = match a[4].as_str() {
        "rigid" => RobotModel::Rigid,
        "gear" => RobotModel::Gear,
        _ => RobotModel::Full,
    };
    let hard = a.get(5).is_some();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut g = |s: f64| {
        let x: f64 = StandardNormal.sample(&mut rng);
        x * s
    };
    let desc = robotcal::urdf::read(std::path::Path::new("robots/kuka_kr6_r900/kuka_kr6_r900.urdf")).unwrap();
    let chain = desc.chain(None, None).unwrap();
    let mut truth = RobotModel::Rigid.robot(chain.clone());
    for (x, j) in truth.twists.iter_mut().zip(&chain.joints) {
        if j.drive.is_some() {
            *x = Vector6::new(g(3e-4), g(3e-4), g(3e-4), g(1e-3), g(1e-3), g(1e-3));
        }
    }
    for t in truth.terms.iter_mut() {
        t.value = g(3e-3);
    }
    let nominal = Robot::nominal(chain.clone());
    let mut plate = Plate::lattice(PlateKind::Points, 28, 18, 0.018, 1e-4);
    for m in plate.markers.iter_mut() {
        m.outer_radius_m = 0.0054;
    }
    let truemark: Vec<Vector3<f64>> =
        plate.markers.iter().map(|m| m.position_m + Vector3::new(g(5e-5), g(5e-5), g(5e-5))).collect();
    let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 1100.0);
    camera.parameters = vec![1103.0, 1101.0, 645.0, 508.0, -0.15, 0.03, 8e-4, -5e-4, 0.0];
    let x = Pose::from_xyz_rpy([0.04, -0.05, 0.06], [0.05, -0.2, 0.4]);
    let q0 = [0.1, -1.6, 1.9, 0.2, 1.2, 0.3];
    let c0 = &nominal.base_from_tip(&q0) * &x;
    // plate 0.35 m in front of the camera, facing it
    let z = &c0
        * &Pose::new(
            robotcal::geom::exp_so3(&Vector3::new(std::f64::consts::PI, 0.0, 0.0)),
            Vector3::new(0.0, 0.0, 0.35),
        );
    let mut stops = vec![];
    let mut tested = vec![];
    let u = Uniform::new(-1.0, 1.0).unwrap();
    let mut rng2 = rand_chacha::ChaCha8Rng::seed_from_u64(seed + 1000);
    while stops.len() < n || tested.len() < 200 {
        let scale = [0.5, 0.5, 0.5, 1.2, 0.8, 2.5];
        let q: Vec<f64> = (0..6).map(|i| q0[i] + scale[i] * u.sample(&mut rng2)).collect();
        let c = CameraMount::Hand.camera_from_plate(&x, &nominal.base_from_tip(&q), &z);
        if c.rotation.column(2).dot(&c.translation.normalize()) > -0.6
            || c.translation.norm() > 0.6
            || c.translation.norm() < 0.15
        {
            continue;
        }
        let tip = truth.base_from_tip(&q);
        let pose = CameraMount::Hand.camera_from_plate(&x, &tip, &z);
        let mut obs = vec![];
        for (k, m) in plate.markers.iter().enumerate() {
            if let Some(uv) = centroid_uv(&camera, &pose, &truemark[k], m.outer_radius_m) {
                if camera.contains(&uv, 8.0) {
                    obs.push(Observation {
                        marker: m.id,
                        edge: Edge::Outer,
                        uv: (uv + Vector2::new(g(0.05), g(0.05))).into(),
                        covariance: Some([0.0016, 0.0, 0.0016]),
                    });
                }
            }
        }
        if obs.len() < 40 {
            continue;
        }
        if stops.len() < n {
            let qr: Vec<f64> = q.iter().map(|v| v + g(sq)).collect();
            stops.push(MeasuredStop {
                image: format!("im{:03}", stops.len()),
                readings: Some(qr),
                placement: "p".into(),
                observations: obs,
                left_out: None,
            });
        } else {
            tested.push(q);
        }
    }
    let obs: usize = stops.iter().map(|s| s.observations.len()).sum();
    let series = MeasuredSeries {
        name: "s".into(),
        camera: "front".into(),
        mounting: "m".into(),
        mount: CameraMount::Hand,
        width_px: 1280,
        height_px: 1024,
        focal_px: None,
        lens: Lens::Brown,
        centroid: true,
        plate,
        plate_name: "pl".into(),
        order_known: true,
        stops,
    };
    let t0 = std::time::Instant::now();
    let s = identify(
        chain.clone(),
        &[series],
        &Options {
            model,
            joint_noise: if hard { JointNoise::Known(0.0) } else { JointNoise::Estimated },
            ..Options::default()
        },
    )
    .unwrap();
    println!("obs {obs} time {:?} iter {}", t0.elapsed(), s.iterations);
    for v in &s.starts {
        println!("{v:?}");
    }
    println!(
        "free rms {} factor {:?} joint {:?}",
        s.free_poses.rms_px, s.problem.noise.pixel_factor, s.problem.noise.joint
    );
    println!("{:?}", (&s.accuracy.nominal, &s.accuracy.calibrated));
    println!(
        "left out {:?} gates {:?}",
        s.problem.images.iter().filter(|i| i.rejected.is_some()).map(|i| (&i.name, &i.rejected)).collect::<Vec<_>>(),
        s.failed_gates
    );
    println!(
        "camera {:?} sig {:?}",
        s.state.cameras[0].parameters,
        s.problem.layout.cameras[0].clone().map(|c| s.covariance.sigma(c)).collect::<Vec<_>>()
    );
    // held-out flange relative to plate after gauge alignment: best rigid Z and X' (plate frame, tip frame)
    let err = |rob: &Robot, zz: &Pose, xx: &Pose| {
        // compare plate_from_camera predicted
        let mut e = 0.0;
        for q in &tested {
            let p = &(&zz.inverse() * &rob.base_from_tip(q)) * xx;
            let t = &(&z.inverse() * &truth.base_from_tip(q)) * &x;
            e += (p.translation - t.translation).norm_squared();
        }
        (e / tested.len() as f64).sqrt() * 1e3
    };
    println!(
        "camera in plate error mm calibrated {:.4}",
        err(&s.state.robot, &s.state.placements[0], &s.state.mountings[0])
    );
}
