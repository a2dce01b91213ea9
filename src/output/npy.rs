//! A matrix as NumPy stores it (`.npy`, version 1.0): `numpy.load` reads it, and so do Julia, R and MATLAB with a package.

use nalgebra::DMatrix;

/// Alignment of the data.
const ALIGNED: usize = 64;

/// The bytes of the file, rows one after the other.
pub(super) fn matrix(m: &DMatrix<f64>) -> Vec<u8> {
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}", m.nrows(), m.ncols());
    let before = 10;
    let padding = ALIGNED - (before + header.len() + 1) % ALIGNED;
    header.push_str(&" ".repeat(padding % ALIGNED));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(m.transpose().iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_are_aligned_and_stand_row_by_row() {
        let bytes = matrix(&DMatrix::from_row_slice(2, 3, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!((bytes.len() - 48) % ALIGNED, 0);
        let numbers: Vec<f64> =
            bytes[bytes.len() - 48..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(numbers, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert!(bytes.starts_with(b"\x93NUMPY") && bytes[bytes.len() - 49] == b'\n');
    }
}
