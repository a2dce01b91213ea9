//! `cv::FileStorage` in YAML, XML and JSON, with the keys of OpenCV's calibration sample; written as YAML.

use std::path::Path;

use serde_json::{Value, json};

use super::model::{ReadCamera, Sayable};
use super::ros;
use super::yaml::{Calibration, parse, pinhole};
use crate::error::{Code, Error, Result};
use crate::model::camera::{Camera, Lens};
use crate::output::text::list;

pub(super) const SAYABLE: &[Sayable] = &[
    Sayable::whole(Lens::Brown),
    Sayable::whole(Lens::Rational),
    Sayable::whole(Lens::ThinPrism),
    Sayable::whole(Lens::Fisheye),
];

/// The coefficients as OpenCV takes them.
pub(super) fn coefficients(camera: &Camera) -> Vec<f64> {
    let k = &camera.parameters[4..camera.parametric()];
    match camera.lens {
        Lens::ThinPrism => [&k[..5], &[0.0; 3], &k[5..]].concat(),
        _ => k.to_vec(),
    }
}

pub(super) fn text(camera: &Camera) -> String {
    let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|k| camera.parameters[k]);
    let d = coefficients(camera);
    let fisheye = if camera.lens == Lens::Fisheye { "fisheye_model: 1\n" } else { "" };
    let matrix = |rows: usize, columns: usize, data: &[f64]| {
        let data = list(data.iter().copied());
        format!(" !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {data}\n")
    };
    format!(
        "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n{fisheye}camera_matrix:{}distortion_coefficients:{}",
        camera.width_px,
        camera.height_px,
        matrix(3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        matrix(d.len(), 1, &d),
    )
}

pub(super) fn read(path: &Path, text: &str) -> Result<ReadCamera> {
    let remedy = "give image_width, image_height, camera_matrix and distortion_coefficients, as OpenCV's calibration sample writes them";
    let file: Calibration = match text.trim_start().as_bytes() {
        [b'<', ..] => of_xml(text).map_err(|e| Error::new(Code::SettingSyntax, path.display(), e, remedy))?,
        _ => parse(path, text, remedy)?,
    };
    let (size, d) = ([file.image_width, file.image_height], &file.distortion_coefficients.data);
    let pinhole = pinhole(path, &file.camera_matrix.data)?;
    // Files with the keys of both name the model as ROS does.
    let model = if file.fisheye_model != 0 { Some("fisheye") } else { file.distortion_model.as_deref() };
    ros::with_model(path, model, (file.camera_name, size, pinhole), d)
}

/// The same from XML: every element of the storage is a number, a text or a matrix.
fn of_xml(text: &str) -> std::result::Result<Calibration, String> {
    let document = roxmltree::Document::parse(text).map_err(|e| e.to_string())?;
    let plain = |n: roxmltree::Node| n.text().unwrap_or_default().trim().trim_matches('"').to_owned();
    let scalar = |text: &str| text.parse::<f64>().ok().map_or_else(|| Value::from(text), number_of);
    let of = |n: roxmltree::Node| match n.children().find(|c| c.has_tag_name("data")) {
        Some(data) => json!({ "data": plain(data).split_whitespace().map(scalar).collect::<Vec<_>>() }),
        None => scalar(&plain(n)),
    };
    let all = document.root_element().children().filter(roxmltree::Node::is_element);
    let keyed = all.map(|n| (n.tag_name().name().to_owned(), of(n))).collect::<serde_json::Map<_, _>>();
    serde_json::from_value(Value::Object(keyed)).map_err(|e| e.to_string())
}

/// Sizes are whole numbers.
fn number_of(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < f64::from(u32::MAX) { json!(value as i64) } else { json!(value) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::camera_formats::read_camera_file;

    /// What `cv::FileStorage` writes of one camera, by the extension: OpenCV 4, and the sample of OpenCV 2 with its capitals.
    const XML: &str = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<calibration_time>\"Tue Nov 24 2026\"</calibration_time>\n<image_width>1280</image_width>\n\
        <image_height>720</image_height>\n<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    \
        9.0e+02 0. 6.395e+02 0. 9.01e+02 3.595e+02 0. 0. 1.</data></camera_matrix>\n<distortion_coefficients type_id=\"opencv-matrix\">\n  <rows>5</rows>\n  \
        <cols>1</cols>\n  <dt>d</dt>\n  <data>\n    -1.0e-01 2.0e-02 1.0e-03 -2.0e-03 0.</data></distortion_coefficients>\n</opencv_storage>\n";
    const JSON: &str = "{ \"image_width\": 1280, \"image_height\": 720, \"camera_matrix\": { \"type_id\": \"opencv-matrix\", \"rows\": 3, \"cols\": 3, \"dt\": \"d\",\n\
        \"data\": [ 9.0e+02, 0.0, 6.395e+02, 0.0, 9.01e+02, 3.595e+02, 0.0, 0.0, 1.0 ] }, \"distortion_coefficients\": { \"type_id\": \"opencv-matrix\",\n\
        \"rows\": 5, \"cols\": 1, \"dt\": \"d\", \"data\": [ -1.0e-01, 2.0e-02, 1.0e-03, -2.0e-03, 0.0 ] } }\n";

    #[test]
    fn storages_in_xml_and_json_are_the_one_in_yaml() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            read_camera_file(&path, None).unwrap().camera
        };
        let camera = of("camera.xml", XML);
        assert_eq!((camera.width_px, camera.height_px, camera.lens), (1280, 720, Lens::Brown));
        assert_eq!(camera.parameters, [900.0, 901.0, 639.5, 359.5, -0.1, 0.02, 1e-3, -2e-3, 0.0]);
        let capitals = [("camera_matrix", "Camera_Matrix"), ("distortion_c", "Distortion_C"), ("image_w", "image_W")];
        let old = capitals.iter().fold(XML.replace("image_h", "image_H"), |text, (new, old)| text.replace(new, old));
        for (name, text) in [("camera.json", JSON), ("camera.yaml", text(&camera).as_str()), ("old.xml", old.as_str())]
        {
            assert_eq!(of(name, text), camera, "{name}");
        }
    }

    #[test]
    fn a_storage_that_names_its_model_is_read_as_that() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.xml");
        let named = |model: &str| {
            let four = XML.replace("<rows>5", "<rows>4").replace(" 0.</data></distortion", "</data></distortion");
            let model = format!("<distortion_model>{model}</distortion_model>\n<distortion_coefficients ");
            std::fs::write(&path, four.replace("<distortion_coefficients ", &model)).unwrap();
            read_camera_file(&path, None)
        };
        for (model, lens) in [("plumb_bob", Lens::Brown), ("radtan", Lens::Brown), ("equidistant", Lens::Fisheye)] {
            let camera = named(model).unwrap().camera;
            assert_eq!((camera.lens, &camera.parameters[4..8]), (lens, &[-0.1, 0.02, 1e-3, -2e-3][..]), "{model}");
        }
        assert_eq!(named("omni").unwrap_err().code, Code::LensUnknown);
    }

    #[test]
    fn a_storage_that_lacks_something_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        for text in
            [XML.replace("image_height", "height"), XML.replace("3.595e+02", "east"), XML.replace("</opencv", "<")]
        {
            let path = folder.path().join("camera.xml");
            std::fs::write(&path, text).unwrap();
            let refused = read_camera_file(&path, None).unwrap_err();
            assert_eq!((refused.code, refused.place.ends_with("camera.xml")), (Code::SettingSyntax, true));
        }
    }
}
