//! Dense factorisations of the reduced system; the only room that imports `faer`.
