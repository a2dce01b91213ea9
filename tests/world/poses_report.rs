//! report.html of `robotcal poses`: complete, self-contained, and of one mind with the exit code.

use std::collections::BTreeSet;
use std::path::Path;

use crate::program::robotcal;
use crate::robots::kr6_urdf;
use robotcal::Code;

/// A simulated series of that many images, with a lens, as observations.
fn simulated(folder: &Path, images: usize, lens: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let urdf = kr6_urdf();
    let plate = root.join("datasets/kr6_small/plate.toml");
    let series = folder.join("run 1").display().to_string();
    let [urdf, plate] = [&urdf, &plate].map(|path| path.to_str().unwrap());
    let (images, wanted) = (images.to_string(), ["--observations", "--held-out", "0", "--lens", lens]);
    let made = [&["simulate", "--urdf", urdf, "--plate", plate, "--images", &images, "--out", &series], &wanted[..]];
    assert!(robotcal(&made.concat()).status.success());
    series
}

/// What `poses` makes of a series.
struct Made {
    exit: Option<i32>,
    page: String,
    record: serde_json::Value,
}

fn poses(folder: &Path, series: &str, more: &[&str]) -> Made {
    let out = folder.join("poses");
    let output = robotcal(&[&["poses", "--series", series, "--out", out.to_str().unwrap()], more].concat());
    let read = |name: &str| std::fs::read(out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}: {output:?}"));
    let page = String::from_utf8(read("report.html")).unwrap();
    Made { exit: output.status.code(), page, record: serde_json::from_slice(&read("poses.json")).unwrap() }
}

impl Made {
    fn chapters(&self) -> Vec<&str> {
        self.page.split("<section id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect()
    }

    fn chapter(&self, id: &str) -> &str {
        let rest = self.page.split_once(&format!("<section id=\"{id}\"")).unwrap().1;
        rest.split_once("</section>").unwrap().0
    }

    /// Names in the table of images, with what stands in the last column.
    fn table(&self) -> Vec<(&str, &str)> {
        let rows = self.chapter("images").split("<td class=\"name\">").skip(1);
        let cell = |text| str::split_once(text, "</td>").unwrap();
        rows.map(|row| (cell(row).0, row.rsplit_once("<td").unwrap().1.split_once('>').unwrap().1))
            .map(|(name, last)| (name, cell(last).0))
            .collect()
    }

    fn verdict(&self) -> &str {
        self.page.split_once("class=\"verdict ").unwrap().1.split('"').next().unwrap()
    }

    fn stands_by_itself(&self) {
        for foreign in ["<link", "<img", "src=", "@import", "url(", "https:"] {
            assert!(!self.page.contains(foreign), "the page contains {foreign}");
        }
        for link in self.page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            let id = link.strip_prefix('#').unwrap_or_else(|| panic!("{link} leads out of the page"));
            assert!(self.page.contains(&format!("id=\"{id}\"")), "{link} leads nowhere");
        }
        for broken in ["NaN", ">inf", "-inf"] {
            assert!(!self.page.contains(broken), "the page says {broken}");
        }
        // Files that were read may have any name.
        let body = self.page.split_once("<body").unwrap().1.split_once("<section id=\"record\"").unwrap().0;
        let said: BTreeSet<&str> = body.split(|c: char| !c.is_alphabetic()).collect();
        let of_robots = BTreeSet::from(["robot", "flange", "joint", "joints", "arm", "Arm", "tip"]);
        assert_eq!(of_robots.intersection(&said).next(), None);
    }
}

#[test]
fn a_good_series_has_every_chapter_and_a_row_for_each_image() {
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(folder.path(), 12, "brown");
    let truth = format!("{series}/truth.toml");
    let made = poses(folder.path(), &series, &["--against", &truth]);
    assert_eq!((made.exit, made.verdict()), (Some(0), "good"));
    let expected = [
        "findings",
        "left-out",
        "images",
        "scene",
        "against",
        "coverage",
        "residuals",
        "cameras",
        "plate",
        "starts",
        "record",
    ];
    assert_eq!(made.chapters(), expected);
    made.stands_by_itself();
    let images: Vec<&str> =
        made.record["images"].as_array().unwrap().iter().map(|i| i["image"].as_str().unwrap()).collect();
    assert_eq!(images.len(), 12);
    let listed: Vec<&str> = made.table().into_iter().map(|(name, _)| name).collect();
    assert_eq!(listed, images);
    // Over the image and over the plate; the course of the differences; a view for every image.
    assert_eq!(made.chapter("residuals").matches("<figure>").count(), 2);
    assert_eq!(made.chapter("against").matches("<figure>").count(), 1);
    assert_eq!(made.chapter("scene").matches("class=\"camera\"").count(), 12);
    let sigma = made.record["images"][3]["position_sigma_m"].as_f64().unwrap();
    assert!(made.chapter("images").contains(&format!("<td class=\"n\">{:.4}</td>", 1e3 * sigma)));
    for file in made.record["files"].as_array().unwrap() {
        assert!(folder.path().join("poses").join(file.as_str().unwrap()).is_file(), "{file}");
        assert!(made.chapter("record").contains(file.as_str().unwrap()), "{file}");
    }
    for input in made.record["inputs"].as_array().unwrap() {
        assert!(made.chapter("record").contains(input["sha256"].as_str().unwrap()), "{input}");
    }
}

/// Has the images of a series taken by two cameras by turns.
fn of_two_cameras(series: &str) {
    let change = |name: &str, change: &dyn Fn(&str) -> String| {
        let file = Path::new(series).join(name);
        std::fs::write(&file, change(&std::fs::read_to_string(&file).unwrap())).unwrap();
    };
    let size = "width_px = 1280\nheight_px = 1024\n";
    change("series.toml", &|text| {
        let (before, _) = text.split_once("camera_mount").unwrap();
        let camera = |name: &str| format!("[[camera]]\nname = \"{name}\"\nmount = \"hand\"\n{size}");
        format!("{before}plate = \"plate.toml\"\n{}{}", camera("left"), camera("right"))
    });
    let mut images = "stop,camera,image\n".to_owned();
    let joints = std::fs::read_to_string(Path::new(series).join("joints.csv")).unwrap();
    for (k, image) in joints.lines().skip(1).filter_map(|line| line.split(',').next()).enumerate() {
        images += &format!("{image},{},{image}\n", ["left", "right"][k % 2]);
    }
    std::fs::write(Path::new(series).join("images.csv"), images).unwrap();
    change("joints.csv", &|text| text.replacen("image,", "stop,", 1));
}

#[test]
fn a_series_of_two_cameras_is_adjusted_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(folder.path(), 24, "brown");
    of_two_cameras(&series);
    let made = poses(folder.path(), &series, &["--against", &format!("{series}/truth.toml")]);
    assert_eq!((made.exit, made.verdict()), (Some(0), "good"));
    made.stands_by_itself();
    assert_eq!(made.table().len(), 24);
    for camera in ["left", "right"] {
        assert!(folder.path().join(format!("poses/camera.{camera}.yaml")).is_file(), "{camera}");
    }
    let off = made.record["against"]["normalised_error_squared"].as_f64().unwrap();
    // Of 144 numbers, that the cameras' parameters have in common.
    assert!((0.3..2.5).contains(&off), "{off}");
}

/// As a viewer that turns a picture by half a turn leaves it.
#[test]
fn an_image_that_is_left_out_is_named_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(folder.path(), 12, "brown");
    let file = format!("{series}/observations.csv");
    let turned = "img_004.png";
    let turn = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if cells[0] == turned {
            for (at, size) in [(2, 1280.0), (3, 1024.0)] {
                cells[at] = (size - 1.0 - cells[at].parse::<f64>().unwrap()).to_string();
            }
        }
        cells.join(",") + "\n"
    };
    let observed: String = std::fs::read_to_string(&file).unwrap().lines().map(turn).collect();
    std::fs::write(&file, observed).unwrap();
    let made = poses(folder.path(), &series, &[]);
    made.stands_by_itself();
    let reason = made.record["images"][4]["left_out"].as_str().unwrap();
    assert_eq!(made.table().len(), 12);
    let out: Vec<(&str, &str)> = made.table().into_iter().filter(|(_, last)| !last.is_empty()).collect();
    let [(name, why)] = out[..] else { panic!("{out:?}") };
    assert!(name == turned && !reason.is_empty());
    let shown =
        |page: &str| page.replace("&gt;", ">").replace("&lt;", "<").replace("&amp;", "&").replace("&quot;", "\"");
    assert_eq!(shown(why), reason);
    let listed = shown(made.chapter("left-out"));
    assert!(listed.contains(turned) && listed.contains(reason), "{listed}");
    assert_eq!(made.chapter("scene").matches("class=\"camera\"").count(), 11);
}

#[test]
fn a_lens_that_misfits_fails_the_page_as_well_as_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let series = simulated(folder.path(), 14, "parallax");
    let made = poses(folder.path(), &series, &["--camera", "brown"]);
    assert_eq!((made.exit, made.verdict()), (Some(1), "failed"));
    made.stands_by_itself();
    let findings = made.record["findings"].as_array().unwrap();
    let gates: Vec<_> = findings.iter().filter(|f| f["weight"] == "gate").collect();
    assert!(gates.iter().any(|f| f["code"] == Code::ResidualPattern.name()), "{gates:?}");
    // Each stands on the first page, among the findings, and its remedy in what to do, too.
    for gate in gates {
        let part = |name: &str| gate[name].as_str().unwrap().replace('"', "&quot;");
        assert!(made.page.matches(&part("seen")).count() >= 2, "{gate}");
        assert!(made.page.matches(&part("remedy")).count() >= 3, "{gate}");
    }
    assert_eq!(made.chapter("residuals").matches("<figure>").count(), 2);
}
