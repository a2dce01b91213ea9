//! The whole of `identify`, as a user runs it: CPU seconds, seconds by the clock, largest memory.
//!
//! `cargo bench --bench identify` runs the series that comes with the program and simulated ones with observations. After `--`, other
//! series may be named (`URDF SERIES[,SERIES..]`, in pairs), and `--images N,N,..` for other simulated ones. Times hold for the machine
//! that they were taken on: compare programs in turn, by CPU seconds.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

type Fallible<T> = Result<T, Box<dyn Error>>;

const PROGRAM: &str = env!("CARGO_BIN_EXE_robotcal");
const ROBOT: &str = "robots/kuka_kr6_r900/kuka_kr6_r900.urdf";
/// How often the process is looked at.
const EVERY: Duration = Duration::from_millis(5);

/// What a run took.
struct Spent {
    cpu_s: f64,
    wall_s: f64,
    memory_mb: f64,
}

/// Ticks of a process so far and its largest memory, kB; none where it has ended, or the system does not tell.
fn looked_at(process: u32) -> Option<(f64, f64)> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let memory = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some((ticks, memory.split_whitespace().next()?.parse().ok()?))
}

fn run(arguments: &[&str]) -> Fallible<Spent> {
    let start = Instant::now();
    let mut child = Command::new(PROGRAM).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    let (mut ticks, mut memory_kb) = (0.0, 0.0);
    while child.try_wait()?.is_none() {
        (ticks, memory_kb) = looked_at(child.id()).unwrap_or((ticks, memory_kb));
        std::thread::sleep(EVERY);
    }
    // Linux counts a hundred ticks a second.
    Ok(Spent { cpu_s: ticks / 100.0, wall_s: start.elapsed().as_secs_f64(), memory_mb: memory_kb / 1024.0 })
}

fn identify(name: &str, urdf: &str, series: &[&str], folder: &Path) -> Fallible<()> {
    let out = folder.join("out");
    let out = out.to_string_lossy();
    let mut arguments = vec!["identify", "--urdf", urdf, "--out", &out];
    series.iter().for_each(|s| arguments.extend(["--series", s]));
    let Spent { cpu_s, wall_s, memory_mb } = run(&arguments)?;
    println!("{name:40} {cpu_s:9.2} {wall_s:9.2} {:9.2} {memory_mb:9.0}", wall_s / cpu_s);
    Ok(())
}

fn simulated(images: &str, folder: &Path) -> Fallible<PathBuf> {
    let series = folder.join(format!("observations-{images}"));
    let out = series.to_string_lossy();
    run(&["simulate", "--urdf", ROBOT, "--observations", "--seed", "3", "--images", images, "--out", &out])?;
    Ok(series)
}

fn main() -> Fallible<()> {
    let folder = std::env::temp_dir().join(format!("robotcal-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let mut given: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let mut images = "25,50,100".to_owned();
    if let Some(at) = given.iter().position(|a| a == "--images") {
        images = given.get(at + 1).ok_or("--images needs numbers")?.clone();
        given.drain(at..=at + 1);
    }
    println!("{:40} {:>9} {:>9} {:>9} {:>9}", "work", "CPU s", "wall s", "wall/CPU", "MB");
    identify("kr6_small, 24 images", ROBOT, &["datasets/kr6_small"], &folder)?;
    for pair in given.chunks_exact(2) {
        let series: Vec<&str> = pair[1].split(',').collect();
        identify(&pair[1], &pair[0], &series, &folder)?;
    }
    for images in images.split(',') {
        let series = simulated(images, &folder)?;
        identify(&format!("{images} images, observations"), ROBOT, &[&series.to_string_lossy()], &folder)?;
    }
    std::fs::remove_dir_all(&folder)?;
    Ok(())
}
