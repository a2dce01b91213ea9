//! Definitions of the ROS messages that are written, as a recording carries them: the message, then its parts.

const RULE: &str = "================================================================================";

const HEADER: [(&str, &str); 2] = [
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id"),
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
];

/// Name of the type of transforms.
pub(super) const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";

/// The definition of one of the written types.
pub(super) fn definition(schema: &str) -> String {
    let (own, parts): (&str, &[(&str, &str)]) = match schema {
        super::messages::JOINT_STATE => {
            ("std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort", &[])
        }
        super::messages::COMPRESSED_IMAGE => ("std_msgs/Header header\nstring format\nuint8[] data", &[]),
        super::messages::CAMERA_INFO => (
            "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\n\
             float64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
            &[(
                "sensor_msgs/RegionOfInterest",
                "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify",
            )],
        ),
        _ => (
            "geometry_msgs/TransformStamped[] transforms",
            &[
                (
                    "geometry_msgs/TransformStamped",
                    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
                ),
                ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"),
                ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z"),
                ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"),
            ],
        ),
    };
    let parts = parts.iter().chain(&HEADER).map(|(name, text)| format!("\n{RULE}\nMSG: {name}\n{text}"));
    own.to_string() + &parts.collect::<String>() + "\n"
}

/// JSON schema of the marks on images, by the name that viewers know.
pub(super) const ANNOTATIONS: &str = "foxglove.ImageAnnotations";

/// The schema text of [`ANNOTATIONS`], as far as it is used.
pub(super) const ANNOTATIONS_SCHEMA: &str = r#"{"title":"foxglove.ImageAnnotations","type":"object","properties":{
"circles":{"type":"array","items":{"type":"object"}},"texts":{"type":"array","items":{"type":"object"}},
"points":{"type":"array","items":{"type":"object","properties":{
"timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},"nsec":{"type":"integer"}}},
"type":{"type":"integer"},"points":{"type":"array","items":{"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"}}}},
"outline_color":{"type":"object"},"outline_colors":{"type":"array","items":{"type":"object"}},"fill_color":{"type":"object"},
"thickness":{"type":"number"}}}}}}"#;
