//! Frames as users write them beside a program: numbers alone, or as they stand in a language.

/// Components of a frame of KRL, in their order.
const KRL: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];

/// Numbers separated by commas.
pub(super) fn list(text: &str) -> Option<Vec<f64>> {
    text.split(',').map(|number| number.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect()
}

/// What stands between two marks and spaces.
fn between<'t>(text: &'t str, open: &str, close: &str) -> Option<&'t str> {
    text.trim().strip_prefix(open)?.strip_suffix(close).map(str::trim)
}

/// `{X 1,Y 2,Z 3,A 0,B 0,C 0}`, in whatever order, perhaps with the type before it.
pub(super) fn krl(text: &str) -> Option<Vec<f64>> {
    let inside = between(text, "{", "}")?;
    let parts = inside.rsplit_once(':').map_or(inside, |(_, parts)| parts);
    let mut found = [None; KRL.len()];
    for part in parts.split(',') {
        let (name, number) = part.trim().split_once(char::is_whitespace)?;
        let place = KRL.iter().position(|known| known.eq_ignore_ascii_case(name))?;
        let is_again = found[place].replace(*list(number)?.first()?).is_some();
        (!is_again).then_some(())?;
    }
    found.into_iter().collect()
}

/// `p[x, y, z, rx, ry, rz]`.
pub(super) fn urscript(text: &str) -> Option<Vec<f64>> {
    list(between(text, "p[", "]")?)
}

/// `[[x, y, z], [q1, q2, q3, q4]]`.
pub(super) fn rapid(text: &str) -> Option<Vec<f64>> {
    let (place, turn) = between(text, "[", "]")?.split_once(']')?;
    let place = list(place.trim().strip_prefix('[')?)?;
    let turn = list(between(turn.trim().strip_prefix(',')?, "[", "]")?)?;
    ((place.len(), turn.len()) == (3, 4)).then(|| [place, turn].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_read_as_the_language_writes_it_and_nothing_else_is() {
        let six = Some(vec![10.0, -20.0, 1.5, 0.0, 90.0, 1e-3]);
        assert_eq!(list("10, -20,1.5,0,90,1e-3"), six);
        assert_eq!(krl("{X 10,Y -20,Z 1.5,A 0,B 90,C 1e-3}"), six);
        assert_eq!(krl(" {FRAME: y -20, x 10.0,Z 1.5, A 0,C 0.001,B 90} "), six);
        assert_eq!(urscript("p[10, -20, 1.5, 0, 90, 0.001]"), six);
        assert_eq!(rapid("[[1,2,3], [1,0,0,0]]"), Some(vec![1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]));
        for text in ["", "{X 10,Y 20}", "{X 1,X 2,Y 2,Z 3,A 0,B 0,C 0}", "{X 1,Y 2,Z 3,A 0,B 0,C D}", "X 10", "{X10}"] {
            assert_eq!(krl(text), None, "{text}");
        }
        for text in
            ["[1,2,3]", "[[1,2],[1,0,0,0,0]]", "[[1,2,3][1,0,0,0]]", "[[1,2,3],[1,0,0,0]", "[[1,2,nan],[1,0,0,0]]"]
        {
            assert_eq!(rapid(text), None, "{text}");
        }
        assert_eq!((list("1,,2"), list("1,inf"), urscript("[1,2]")), (None, None, None));
    }
}
