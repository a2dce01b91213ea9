//! What `compensate` says of files that are not what they should be: no targets, other line ends, other descriptions.

use crate::programs_support::{Cell, Run, findings};
use robotcal::Code;

fn weight(run: &Run, code: Code) -> Option<String> {
    findings(run).get(code.name()).map(|(weight, _)| weight.clone())
}

#[test]
fn a_text_without_a_target_is_not_corrected() {
    let cell = Cell::kuka(121);
    let other = "/PROG MOVE\n/MN\n   1:J P[1] 100% FINE    ;\n   2:L P[2] 250mm/sec FINE    ;\n/END\n";
    for text in ["", other] {
        for language in ["krl", "rapid", "urscript"] {
            let file = cell.write("other.ls", text.as_bytes());
            let run = cell.compensate(&[&file], &["--language", language]).expect(1);
            assert_eq!(weight(&run, Code::TargetsMissing).as_deref(), Some("gate"), "{language}: {text}");
        }
    }
}

#[test]
fn line_ends_without_line_feed_are_line_ends() {
    let mut cell = Cell::kuka(122);
    let q: Vec<f64> = cell.readings().iter().map(|v| v.to_degrees()).collect();
    let axes: Vec<String> = q.iter().enumerate().map(|(k, v)| format!("A{} {v:.4}", k + 1)).collect();
    let header = cell.nominal.chain.readings.join(",");
    let row: Vec<String> = q.iter().map(|v| format!("{v:.4}")).collect();
    let krl = format!("DEF a()\n; PTP\nPTP {{{}}}\nLIN XQ\nEND\n", axes.join(","));
    let rapid = format!(
        "MODULE m\nPROC main()\n! Move\nMoveAbsJ [{q:?},[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,tool0;\nMoveJ p,v1,z1,tool0;\nENDPROC\nENDMODULE\n"
    );
    for (name, text, line) in
        [("a.src", krl, Some(4)), ("m.mod", rapid, Some(5)), ("t.csv", format!("{header}\n{}\n", row.join(",")), None)]
    {
        let run = |text: &str| {
            let file = cell.write(name, text.as_bytes());
            let run = cell.compensate(&[&file], &["--unordered", "--joint-unit", "deg"]);
            let told = run.told();
            assert_eq!(told.corrected, 1, "{name}");
            assert_eq!(told.left.first().map(|l| l.0), line, "{name}");
            run.text(name)
        };
        let old_style = run(&text.replace('\n', "\r"));
        assert_eq!(old_style.replace('\r', "\n"), run(&text));
        assert_ne!(run(&text), text);
    }
}
