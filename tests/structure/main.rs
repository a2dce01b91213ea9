//! Tests of structure; one binary, a file a subject.

mod apart;
mod architecture;
mod circles;
mod codes;
mod features;
mod imports;
mod limits;
mod sentences;
