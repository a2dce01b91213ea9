//! Which marker is which: lattice (from neighbour to neighbour) -> code (where on the plate it lies) -> neighbour_check, by local_map (is every
//! neighbour of one mind).

pub(super) mod code;
pub(super) mod lattice;
pub(super) mod local_map;
pub(super) mod neighbour_check;
