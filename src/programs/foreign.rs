//! Files that are taken for programs, though they hold none that is read: packed ones, and those of other languages.

/// First bytes of packed files, what such a file is, and what to give instead.
const PACKED: [(&[u8], &str, &str); 2] = [
    (
        &[0x1f, 0x8b],
        "is a gzip archive, as PolyScope writes its .urp programs, and no text",
        "give the .script that PolyScope writes beside it",
    ),
    (b"PK\x03\x04", "is a zip archive and no text", "unpack it, and give the programs that are in it"),
];
/// Languages that are not read, by the extensions of their files.
const OTHERS: [(&str, &str); 5] =
    [("ls", "FANUC TP"), ("tp", "FANUC TP"), ("jbi", "Yaskawa INFORM"), ("as", "Kawasaki AS"), ("drl", "Doosan DRL")];

/// What a packed file is by its first bytes, and what to give instead of it.
pub fn packed(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    PACKED.iter().find(|(first, ..)| bytes.starts_with(first)).map(|(_, what, remedy)| (*what, *remedy))
}

/// The language that an extension in lower case tells, where it is one that is not read.
pub(super) fn program(extension: &str) -> Option<&'static str> {
    OTHERS.iter().find(|(known, _)| *known == extension).map(|(_, words)| *words)
}
