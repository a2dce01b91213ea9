//! CDR, the wire format of ROS 2: a borrowed reader whose every step is checked against the end of the message.
//!
//! Source of the format: OMG DDS-XTYPES 1.3, section 7.4 (plain CDR and plain CDR2, both byte orders).

/// Why a message cannot be read.
pub(super) type Malformed = String;

/// Result of reading a part of a message.
pub(super) type Decoded<T> = Result<T, Malformed>;

/// A cursor in the body of one message.
#[derive(Debug, Clone)]
pub(super) struct Cdr<'a> {
    body: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Largest alignment: 8 in CDR, 4 in CDR2.
    max_align: usize,
}

impl<'a> Cdr<'a> {
    /// Reads the encapsulation header.
    pub fn new(message: &'a [u8]) -> Decoded<Self> {
        let [high, low, _, _, body @ ..] = message else { return Err("is shorter than its header".into()) };
        let (big_endian, max_align) = match u16::from_be_bytes([*high, *low]) {
            0 => (true, 8),
            1 => (false, 8),
            6 => (true, 4),
            7 => (false, 4),
            0x28b5 => {
                return Err("is compressed by itself (zstd) and cannot be unpacked".into());
            }
            other => return Err(format!("has the unknown encapsulation {other:#06x}")),
        };
        Ok(Self { body, at: 0, big_endian, max_align })
    }

    fn take(&mut self, count: usize) -> Decoded<&'a [u8]> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.body.len());
        let Some(end) = end else {
            return Err(format!("ends at byte {} where {count} more from {} are needed", self.body.len(), self.at));
        };
        let bytes = &self.body[self.at..end];
        self.at = end;
        Ok(bytes)
    }

    fn primitive<const N: usize>(&mut self) -> Decoded<[u8; N]> {
        self.at = self.at.next_multiple_of(N.min(self.max_align));
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        if !self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub fn u8(&mut self) -> Decoded<u8> {
        self.primitive().map(u8::from_be_bytes)
    }

    pub fn u32(&mut self) -> Decoded<u32> {
        self.primitive().map(u32::from_be_bytes)
    }

    pub fn i32(&mut self) -> Decoded<i32> {
        self.primitive().map(i32::from_be_bytes)
    }

    pub fn f64(&mut self) -> Decoded<f64> {
        self.primitive().map(f64::from_be_bytes)
    }

    /// Length of a sequence whose elements take at least `least` bytes each.
    fn length(&mut self, least: usize) -> Decoded<usize> {
        let length = self.u32()? as usize;
        match length.checked_mul(least) {
            Some(bytes) if bytes <= self.body.len() - self.at => Ok(length),
            _ => Err(format!("states a sequence of {length} elements, more than it holds")),
        }
    }

    /// A string without its closing NUL.
    pub fn string(&mut self) -> Decoded<&'a str> {
        let length = self.length(1)?;
        let bytes = self.take(length)?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(text).map_err(|_| "holds a string that is not UTF-8".into())
    }

    pub fn strings(&mut self) -> Decoded<Vec<String>> {
        let length = self.length(4)?;
        (0..length).map(|_| self.string().map(str::to_string)).collect()
    }

    pub fn bytes(&mut self) -> Decoded<&'a [u8]> {
        let length = self.length(1)?;
        self.take(length)
    }

    pub fn f64s(&mut self) -> Decoded<Vec<f64>> {
        let length = self.length(8)?;
        (0..length).map(|_| self.f64()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Cdr;

    /// u8 7, f64 0.5, string "ab", f64 sequence [2], in plain CDR of either byte order.
    fn message(big: bool) -> Vec<u8> {
        let order = |bytes: Vec<u8>| if big { bytes } else { bytes.into_iter().rev().collect() };
        [
            vec![0, u8::from(!big), 0, 0],
            vec![7, 0, 0, 0, 0, 0, 0, 0],
            order(0.5f64.to_be_bytes().into()),
            order(3u32.to_be_bytes().into()),
            b"ab\0\0".to_vec(),
            order(1u32.to_be_bytes().into()),
            vec![0; 4],
            order(2.0f64.to_be_bytes().into()),
        ]
        .concat()
    }

    fn read(message: &[u8]) -> Result<(u8, f64, String, Vec<f64>), String> {
        let mut cdr = Cdr::new(message)?;
        Ok((cdr.u8()?, cdr.f64()?, cdr.string()?.to_string(), cdr.f64s()?))
    }

    #[test]
    fn both_byte_orders_and_alignments() {
        for big in [false, true] {
            assert_eq!(read(&message(big)), Ok((7, 0.5, "ab".into(), vec![2.0])));
        }
        // CDR2 aligns eight bytes to four.
        let mut short = message(false);
        short[1] = 7;
        short.drain(8..12);
        short.drain(short.len() - 12..short.len() - 8);
        assert_eq!(read(&short), Ok((7, 0.5, "ab".into(), vec![2.0])));
    }

    #[test]
    fn every_truncation_is_an_error_and_none_a_panic() {
        let whole = message(false);
        for length in 0..whole.len() {
            assert!(read(&whole[..length]).is_err(), "{length} bytes");
        }
        let mut huge = whole.clone();
        huge[28..32].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(read(&huge).is_err());
        assert!(Cdr::new(&[0, 9, 0, 0]).unwrap_err().contains("0x0009"));
        assert!(Cdr::new(&[0x28, 0xb5, 0x2f, 0xfd]).unwrap_err().contains("zstd"));
    }
}
