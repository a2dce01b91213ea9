//! Tests of structure; one binary, a file a subject.

mod architecture;
mod circles;
mod imports;
