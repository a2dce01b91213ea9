//! Rotations that were made of three angles as if these were of another convention than they are.

use nalgebra::Matrix3;

use crate::geom::{matrix_from_rpy, rpy_from_matrix};

/// In which order three angles turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    /// About the fixed axes x, y, z.
    Fixed,
    /// About x, y', z''.
    OwnFromX,
    /// About z, y', x''.
    OwnFromZ,
}

impl Order {
    const ALL: [Self; 3] = [Self::Fixed, Self::OwnFromX, Self::OwnFromZ];

    fn name(self) -> &'static str {
        match self {
            Self::Fixed => "about the fixed axes x, y, z",
            Self::OwnFromX => "about x, y', z''",
            Self::OwnFromZ => "about z, y', x''",
        }
    }

    /// The angles of a rotation, rad.
    fn angles(self, rotation: &Matrix3<f64>) -> [f64; 3] {
        match self {
            Self::Fixed => rpy_from_matrix(rotation),
            // Backwards it turns by the angles about the fixed axes, each the other way.
            Self::OwnFromX => rpy_from_matrix(&rotation.transpose()).map(|angle| -angle),
            Self::OwnFromZ => {
                let [roll, pitch, yaw] = rpy_from_matrix(rotation);
                [yaw, pitch, roll]
            }
        }
    }

    fn rotation(self, [a, b, c]: [f64; 3]) -> Matrix3<f64> {
        match self {
            Self::Fixed => matrix_from_rpy([a, b, c]),
            Self::OwnFromX => matrix_from_rpy([-a, -b, -c]).transpose(),
            Self::OwnFromZ => matrix_from_rpy([c, b, a]),
        }
    }
}

/// Angles of one order that were taken for those of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::identify) struct AnglesMisread {
    taken: Order,
    meant: Order,
}

impl AnglesMisread {
    /// All of them.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let of =
            |taken: Order| Order::ALL.into_iter().filter(move |meant| *meant != taken).map(move |meant| (taken, meant));
        Order::ALL.into_iter().flat_map(of).map(|(taken, meant)| Self { taken, meant })
    }

    /// The rotation that was meant.
    pub(super) fn undone(self, rotation: &Matrix3<f64>) -> Matrix3<f64> {
        self.meant.rotation(self.taken.angles(rotation))
    }

    pub(super) fn what(self) -> String {
        format!("quaternions are made of three angles {}, which are those {}", self.taken.name(), self.meant.name())
    }

    pub(super) fn remedy(self) -> String {
        format!("make the quaternions of the angles {}", self.meant.name())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::geom::exp_so3;

    #[test]
    fn angles_turn_about_the_axes_that_are_said() {
        let about = |axis: Vector3<f64>, angle: f64| exp_so3(&(axis * angle));
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let [a, b, c] = [0.4, -0.9, 2.1];
        for (order, turned) in [
            (Order::Fixed, about(z, c) * about(y, b) * about(x, a)),
            (Order::OwnFromX, about(x, a) * about(y, b) * about(z, c)),
            (Order::OwnFromZ, about(z, a) * about(y, b) * about(x, c)),
        ] {
            assert!((order.rotation([a, b, c]) - turned).amax() < 1e-12, "{order:?}");
            assert!((order.rotation(order.angles(&turned)) - turned).amax() < 1e-12, "{order:?}");
        }
        assert_eq!(AnglesMisread::all().count(), 6);
    }
}
