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
        ANNOTATIONS => (
            "foxglove_msgs/CircleAnnotation[] circles\nfoxglove_msgs/PointsAnnotation[] points\n\
             foxglove_msgs/TextAnnotation[] texts",
            ANNOTATION_PARTS,
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

/// Name of the type of marks on images, which viewers know.
pub(super) const ANNOTATIONS: &str = "foxglove_msgs/msg/ImageAnnotations";

/// The parts of [`ANNOTATIONS`].
const ANNOTATION_PARTS: &[(&str, &str)] = &[
    (
        "foxglove_msgs/CircleAnnotation",
        "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nfloat64 diameter\nfloat64 thickness\n\
         foxglove_msgs/Color fill_color\nfoxglove_msgs/Color outline_color",
    ),
    (
        "foxglove_msgs/PointsAnnotation",
        "builtin_interfaces/Time timestamp\nuint8 type\nfoxglove_msgs/Point2[] points\nfoxglove_msgs/Color outline_color\n\
         foxglove_msgs/Color[] outline_colors\nfoxglove_msgs/Color fill_color\nfloat64 thickness",
    ),
    (
        "foxglove_msgs/TextAnnotation",
        "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nstring text\nfloat64 font_size\n\
         foxglove_msgs/Color text_color\nfoxglove_msgs/Color background_color",
    ),
    ("foxglove_msgs/Point2", "float64 x\nfloat64 y"),
    ("foxglove_msgs/Color", "float64 r\nfloat64 g\nfloat64 b\nfloat64 a"),
];
