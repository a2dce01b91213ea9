//! What handlers of errors and trap routines of RAPID switch, where the program goes on behind them.

use crate::programs_support::Cell;
use crate::rapid_statements::assert_told;
use robotcal::programs::LeftReason;

const STEP: &str = "MoveJ @,v1,z1,tGun\\WObj:=wTable;";
const SHIFT: &str = "PDispSet [[100,0,0],[1,0,0,0],[0,0,0],[0,0,0]];";

#[test]
fn what_a_handler_switches_holds_where_its_routine_goes_on() {
    let cell = Cell::kuka(331);
    let frame = LeftReason::FrameUnknown.name();
    let caller = |handler: &str| format!("Sub;\n{STEP}\nENDPROC\nPROC Sub()\n{STEP}\nERROR\n{handler}");
    for (body, corrected, left) in [
        // The move that failed is done again, and every one before it may have been that one.
        (format!("{STEP}\n{STEP}\nERROR\n{SHIFT}\nRETRY;"), 0, vec![frame, frame]),
        (format!("PDispOff;\n{STEP}\n{STEP}\nERROR\n{SHIFT}\nRETRY;"), 0, vec![frame, frame]),
        // The one behind it is next.
        (format!("{STEP}\n{STEP}\nERROR\n{SHIFT}\nTRYNEXT;"), 1, vec![frame]),
        (format!("{STEP}\nPDispOff;\n{STEP}\nERROR\n{SHIFT}\nTRYNEXT;"), 2, vec![]),
        (format!("{STEP}\n{STEP}\nERROR\n{SHIFT}\nPDispOff;\nRETRY;"), 2, vec![]),
        (format!("VAR num n;\n{STEP}\n{STEP}\nERROR\n{SHIFT}\nTRYNEXT;"), 1, vec![frame]),
        (format!("{STEP}\n{STEP}\nERROR\nIF a {SHIFT}\nIF b RETRY;\nTRYNEXT;"), 0, vec![frame, frame]),
        (format!("{STEP}\n{STEP}\nERROR\nTPWrite \"again\";\nRETRY;"), 2, vec![]),
        (format!("{STEP}\n{STEP}\nERROR\nShift;\nTRYNEXT;\nENDPROC\nPROC Shift()\n{SHIFT}"), 1, vec![frame]),
        // A routine that it calls may have failed on its way, and all that it has switched so far holds.
        (
            format!("Shift;\n{STEP}\nERROR\nTRYNEXT;\nENDPROC\nPROC Shift()\n{SHIFT}\nSearchIt;\nPDispOff;"),
            0,
            vec![frame],
        ),
        (format!("Shift;\n{STEP}\nERROR\nRETRY;\nENDPROC\nPROC Shift()\n{SHIFT}\nSearchIt;\nPDispOff;"), 1, vec![]),
        (format!("Shift;\n{STEP}\nENDPROC\nPROC Shift()\n{SHIFT}\nSearchIt;\nPDispOff;"), 1, vec![]),
        (
            format!("Shift;\nPDispOff;\n{STEP}\nERROR\nTRYNEXT;\nENDPROC\nPROC Shift()\n{SHIFT}\nSearchIt;\nPDispOff;"),
            1,
            vec![],
        ),
        // It may fail before it has switched anything.
        (
            format!("{SHIFT}\nUnshift;\n{STEP}\nERROR\nTRYNEXT;\nENDPROC\nPROC Unshift()\nSearchIt;\nPDispOff;"),
            0,
            vec![frame],
        ),
        (format!("{SHIFT}\nUnshift;\n{STEP}\nENDPROC\nPROC Unshift()\nSearchIt;\nPDispOff;"), 1, vec![]),
        // The statement that failed is the last one of a branch or a loop, or the last one before it.
        (format!("WHILE a DO\n{STEP}\nENDWHILE\nERROR\n{SHIFT}\nTRYNEXT;"), 0, vec![frame]),
        (format!("FOR i FROM 1 TO 3 DO\n{STEP}\nENDFOR\nERROR\n{SHIFT}\nTRYNEXT;"), 0, vec![frame]),
        (format!("IF a THEN\n{STEP}\nELSE\nPDispOff;\nENDIF\n{STEP}\nERROR\n{SHIFT}\nTRYNEXT;"), 1, vec![frame]),
        (format!("IF a THEN\n{STEP}\nENDIF\nPDispOff;\n{STEP}\nERROR\n{SHIFT}\nTRYNEXT;"), 2, vec![]),
        (
            format!("TEST a\nCASE 1:\n{STEP}\nDEFAULT:\nPDispOff;\nENDTEST\n{STEP}\nERROR\n{SHIFT}\nTRYNEXT;"),
            1,
            vec![frame],
        ),
        (format!("SearchIt;\nIF a THEN\nPDispOff;\nELSE\n{STEP}\nENDIF\nERROR\n{SHIFT}\nTRYNEXT;"), 0, vec![frame]),
        // The program stops, or its caller goes on.
        (format!("{STEP}\n{STEP}\nERROR\n{SHIFT}\nEXIT;"), 2, vec![]),
        (caller(&format!("{SHIFT}\nRETURN;")), 0, vec![frame, frame]),
        (caller(SHIFT), 0, vec![frame, frame]),
        (caller("RETURN;"), 2, vec![]),
        (caller("RAISE;"), 2, vec![]),
    ] {
        assert_told(&cell, &body, corrected, &left);
    }
    // Whether the codes count is not known, and nothing tells the way.
    let posture = LeftReason::PostureUnknown.name();
    assert_told(&cell, &format!("ConfJ\\On;\n{STEP}\n{STEP}\nERROR\nConfJ\\Off;\nTRYNEXT;"), 2, &[]);
    let turned = format!("ConfJ\\On;\nSearchIt;\n{STEP}\nERROR\nConfJ\\Off;\nTRYNEXT;");
    assert_told(&cell, &turned, 0, &[posture]);
}

/// What may hold where a handler leaves a routine is none of what the routine has switched: its caller's handler does not begin with it.
#[test]
fn what_a_handler_ends_in_stays_with_the_call() {
    let cell = Cell::kuka(334);
    let elsewhere = format!("ENDPROC\nPROC Elsewhere()\n{SHIFT}");
    let sub = "ENDPROC\nPROC Sub()\nPDispOff;\nSearchIt;\nERROR\nPDispOff;\nRETURN;";
    let body = format!("Sub;\nPDispOff;\n{STEP}\nERROR\n{STEP}\nTRYNEXT;\n{sub}\n{elsewhere}");
    assert_told(&cell, &body, 2, &[]);
    // Where the routine does displace, it does.
    let body = body.replacen("PROC Sub()\nPDispOff;", &format!("PROC Sub()\n{SHIFT}\nSearchIt;\nPDispOff;"), 1);
    assert_told(&cell, &body, 1, &[LeftReason::FrameUnknown.name()]);
}

#[test]
fn what_a_trap_routine_switches_may_hold_behind_every_statement() {
    let cell = Cell::kuka(332);
    let frame = LeftReason::FrameUnknown.name();
    let connect = "CONNECT i1 WITH Shifted;\nISignalDI di1,1,i1;";
    for (trap, body, corrected, left) in [
        (SHIFT, format!("{connect}\nPDispOff;\n{STEP}\n{STEP}"), 0, vec![frame, frame]),
        (SHIFT, format!("{STEP}\n{connect}\n{STEP}"), 1, vec![frame]),
        (SHIFT, format!("Start;\nPDispOff;\n{STEP}\nENDPROC\nPROC Start()\n{connect}"), 0, vec![frame]),
        // Whoever calls a routine may have connected it.
        (SHIFT, format!("{connect}\nENDPROC\nPROC Other()\nPDispOff;\n{STEP}"), 0, vec![frame]),
        ("PDispOff;", format!("{connect}\n{STEP}\n{STEP}"), 2, vec![]),
        ("n:=n+1;", format!("{connect}\n{STEP}\n{STEP}"), 2, vec![]),
    ] {
        assert_told(&cell, &format!("{body}\nENDPROC\nTRAP Shifted\n{trap}\nENDTRAP\nPROC Last()"), corrected, &left);
    }
}

/// Axis 4 stays at zero or half a turn: the tool is turned as that allows.
#[test]
fn targets_of_paths_with_axis_4_locked_are_left() {
    let cell = Cell::kuka(333);
    let kept = LeftReason::OrientationKept.name();
    let path = STEP.replace("MoveJ", "MoveL");
    for (body, corrected, left) in [
        (format!("SingArea\\LockAxis4;\n{path}\nSingArea\\Off;\n{path}"), 1, vec![kept]),
        (format!("SingArea \\LockAxis4;\n{STEP}\nMoveC @,@,v1,z1,tGun\\WObj:=wTable;"), 1, vec![kept, kept]),
        (format!("{path}\n{path}\nERROR\nSingArea\\LockAxis4;\nTRYNEXT;"), 1, vec![kept]),
        (format!("SingArea\\Wrist;\n{path}"), 1, vec![]),
    ] {
        assert_told(&cell, &body, corrected, &left);
    }
}
