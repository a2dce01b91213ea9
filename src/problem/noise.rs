//! Variance components.

use crate::urdf::JointKind;

/// Standard deviations that the data themselves decide (variance components).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Noise {
    /// Factor on the stated standard deviations of the observations, per camera.
    pub pixel_factor: Vec<f64>,
    /// Latent joint error of every stop by itself, rad or m: per series, per reading.
    pub joint: Vec<Vec<f64>>,
    /// Local error of every reading, rad or m: common to stops at the same reading. Zero where no stops share readings.
    pub local: Vec<f64>,
    /// Apparent displacement of the plate in every image: per series its tilt, rad; where several cameras see the same stops, behind it spin
    /// (rad), shift across the optical axis and along it (m). Empty where there is none.
    pub displacement: Vec<f64>,
    /// Factors on the stated sigmas of measured bodies, position and rotation, per component of the instruments.
    pub body: Vec<[f64; 2]>,
    /// Factor on the stated tolerances of the markers, per plate. Empty where they are taken as stated.
    pub marker: Vec<f64>,
}

impl Noise {
    /// Number of sizes of apparent displacements per series.
    pub fn displacement_sizes(&self) -> usize {
        self.displacement.len() / self.joint.len().max(1)
    }

    /// The sizes of apparent displacements that are of one kind, series by series.
    pub fn displacement_groups(&self) -> impl Iterator<Item = Vec<usize>> + use<> {
        let (sizes, all) = (self.displacement_sizes(), self.displacement.len());
        (0..sizes).map(move |kind| (kind..all).step_by(sizes).collect())
    }

    /// Sizes of what is latent at stops, rad or m: joint noise, local errors, apparent displacements.
    pub fn latent_sizes(&self) -> impl Iterator<Item = f64> + '_ {
        self.joint.iter().flatten().chain(&self.local).chain(&self.displacement).copied()
    }

    /// As [`Noise::latent_sizes`].
    pub fn latent_sizes_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.joint.iter_mut().flatten().chain(&mut self.local).chain(&mut self.displacement)
    }

    /// Every size of latent joint errors and apparent displacements at `first`, rad or m.
    pub fn start_at(&mut self, first: f64) {
        self.joint.iter_mut().flatten().for_each(|s| *s = first);
        self.local.iter_mut().filter(|s| **s > 0.0).for_each(|s| *s = first);
        self.displacement.fill(first);
    }

    /// Takes over what another problem of the same series found; sizes of latent joint errors and apparent displacements at `least`, rad or m, or more.
    pub fn start_near(&mut self, other: &Self, least: f64) {
        self.pixel_factor.clone_from(&other.pixel_factor);
        self.body.clone_from(&other.body);
        self.marker.clone_from(&other.marker);
        let own = self.joint.iter_mut().flatten().chain(&mut self.displacement);
        let of_other = other.joint.iter().flatten().chain(&other.displacement);
        let local = self.local.iter_mut().zip(&other.local).filter(|(s, _)| **s > 0.0);
        own.zip(of_other).chain(local).filter(|(_, other)| **other > 0.0).for_each(|(s, other)| *s = other.max(least));
    }

    /// Readings whose noise is alike: of one kind, with local errors told apart or not.
    pub fn groups(&self, kinds: &[JointKind]) -> Vec<Vec<usize>> {
        let apart = |r: usize| self.local.get(r).is_some_and(|s| *s > 0.0);
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for r in 0..kinds.len() {
            match groups.iter_mut().find(|g| kinds[g[0]] == kinds[r] && apart(g[0]) == apart(r)) {
                Some(group) => group.push(r),
                None => groups.push(vec![r]),
            }
        }
        groups
    }
}
