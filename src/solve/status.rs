//! How an iteration ended, as people and programs read it.

/// How the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The last step was below the bound.
    Converged,
    /// No step lowered the cost any more.
    Stalled,
    /// The bound on the iterations was reached.
    OutOfIterations,
    /// A marker lies behind its camera at the starting values, or they are not finite.
    BadStart,
}

impl Status {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Converged, Self::Stalled, Self::OutOfIterations, Self::BadStart];

    /// Name in solution.json.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled",
            Self::OutOfIterations => "outofiterations",
            Self::BadStart => "badstart",
        }
    }

    /// What it says, as the end of a sentence on the fit.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stalled => "ended without converging: no step makes it better, and it is not at its best",
            Self::OutOfIterations => "ended without converging: it still changes after as many steps as it may take",
            Self::BadStart => {
                "did not begin: at the starting values a marker lies behind its camera, or they are not finite"
            }
        }
    }

    /// The first thing to look at; empty where nothing is wrong.
    pub const fn remedy(self) -> &'static str {
        match self {
            Self::Converged => "",
            Self::Stalled => {
                "look for what does not belong: rows of other stops, images of another plate or with another focus (`robotcal detect --overlay` shows what is seen in them)"
            }
            Self::OutOfIterations => {
                "the data leave much open: take more stops that move every joint, with the plate seen from more sides; `robotcal identify --dry-run` says what they cannot tell"
            }
            Self::BadStart => {
                "check the units of the readings, the size of the plate, and the camera where a file of it is given"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Status;

    #[test]
    fn all_that_is_not_good_has_a_remedy_and_no_name_of_the_code_in_its_words() {
        for status in Status::ALL {
            assert_eq!(status.remedy().is_empty(), status == Status::Converged);
            let names = [format!("{status:?}"), "outofiterations".to_owned(), "badstart".to_owned()];
            assert!(!names.iter().any(|name| status.words().contains(name)), "{status:?}");
        }
    }
}
