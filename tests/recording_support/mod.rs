//! What a written recording holds, read apart from the program.

/// Kind and points of the layers of a `foxglove_msgs/msg/ImageAnnotations` in little-endian CDR.
pub fn annotations(message: &[u8]) -> Vec<(u8, Vec<[f64; 2]>)> {
    let body = &message[4..];
    let mut at = 0;
    let mut take = |size: usize| {
        at = usize::next_multiple_of(at, size);
        at += size;
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(&body[at - size..at]);
        u64::from_le_bytes(bytes)
    };
    assert_eq!(take(4), 0, "no circles");
    let layers = (0..take(4))
        .map(|_| {
            let (_time, kind) = ([take(4), take(4)], take(1) as u8);
            let points = (0..take(4)).map(|_| [take(8), take(8)].map(f64::from_bits)).collect();
            let _colour = [take(8), take(8), take(8), take(8)];
            assert_eq!(take(4), 0, "no colours of single points");
            let _fill_and_thickness = [take(8), take(8), take(8), take(8), take(8)];
            (kind, points)
        })
        .collect();
    assert_eq!(take(4), 0, "no texts");
    assert_eq!(at, body.len());
    layers
}

/// Types of the fields of a message definition, with its parts, that are neither basic nor defined in it.
#[allow(dead_code)]
pub fn undefined(definition: &str) -> Vec<String> {
    const BASIC: [&str; 8] = ["bool", "uint8", "int32", "uint32", "uint64", "float32", "float64", "string"];
    let defined: Vec<&str> = definition.lines().filter_map(|l| l.strip_prefix("MSG: ")).collect();
    let fields = definition.lines().filter(|l| !l.is_empty() && !l.starts_with("MSG: ") && !l.starts_with('='));
    let types = fields.map(|l| l.split([' ', '[']).next().unwrap());
    types.filter(|t| !BASIC.contains(t) && !defined.contains(t)).map(String::from).collect()
}
