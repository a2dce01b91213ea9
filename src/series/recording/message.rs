//! A message of a recording, whatever holds it.

/// How an MCAP file begins.
pub(super) const MCAP: &[u8] = b"\x89MCAP0\r\n";

/// One message of a recording.
pub(super) struct Message<'a> {
    pub topic: &'a str,
    /// Name of the type.
    pub schema: &'a str,
    /// `cdr` for ROS 2.
    pub encoding: &'a str,
    pub log_time_ns: u64,
    pub data: &'a [u8],
}

/// Where a file is damaged, and how at first.
pub(super) fn at_places(count: u64, first: &str) -> String {
    match count {
        1 => format!("at one place ({first})"),
        _ => format!("at {count} places (the first: {first})"),
    }
}

#[cfg(test)]
mod tests {
    use super::at_places;

    #[test]
    fn one_place_is_no_first_of_several() {
        assert_eq!([at_places(1, "x"), at_places(3, "x")], ["at one place (x)", "at 3 places (the first: x)"]);
    }
}
